"""Detection of all contacts of one frame, for objects whose poses are all new."""
