"""Recording: writes messages into session files."""
