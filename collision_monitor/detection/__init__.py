"""Detection of all contacts of one frame, for objects that all have new poses."""
