"""Tests of one pair of shapes: distance, depth, normal and witness points. `dispatch` holds the table of the tests."""
