"""What a node says of itself: diagnostics, refusals, the times of its steps."""
