"""All contacts of one frame: every pose in, every contact out."""
