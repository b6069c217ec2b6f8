"""What an object is, and what stands for it."""
