"""Measurements of speed against accuracy: trade-off, tuning, extremes, detection time."""
