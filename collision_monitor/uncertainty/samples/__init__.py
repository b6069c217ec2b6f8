"""Samples of the errors of two states, and what each means for the gap of a pair."""
