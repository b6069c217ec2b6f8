"""Where objects will be and when they will meet."""
