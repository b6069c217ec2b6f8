"""The monitor and the stages of its step."""
