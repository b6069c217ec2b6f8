"""How likely two bodies meet, and when, given the errors of their states."""
