"""Time and errors of profiles, models and methods."""
