"""The monitor: a door, and the stages of a step."""
