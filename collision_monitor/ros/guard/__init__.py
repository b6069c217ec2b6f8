"""The guard between a planner and a base."""
