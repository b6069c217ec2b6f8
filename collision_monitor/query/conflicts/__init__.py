"""Whole plans of many objects against each other, ahead of time."""
