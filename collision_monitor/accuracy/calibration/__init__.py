"""How objects of a recording really moved: which model of motion predicts them best, and how far they are off it."""
