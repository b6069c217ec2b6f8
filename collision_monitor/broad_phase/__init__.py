"""Broad phase: pairs with overlapping bounds, by grids and trees, with brute force as the reference."""
