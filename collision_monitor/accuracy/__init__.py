"""What speed costs: trade-off, tuning, extremes."""
