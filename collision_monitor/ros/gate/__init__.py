"""The gate between a planner and a controller."""
