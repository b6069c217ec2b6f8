"""Tests of one pair of shapes: distance, depth, normal, witness points. `dispatch` is the table of them."""
