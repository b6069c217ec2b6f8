"""When two moving shapes first meet."""
