"""The history of a session: its events, and their checks and comparisons."""
