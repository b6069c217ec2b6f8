"""Detection of all contacts of one frame in which every object has a new pose."""
