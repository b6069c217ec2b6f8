"""How well the motions of recorded objects are predicted, by motion model, and how the errors grow."""
