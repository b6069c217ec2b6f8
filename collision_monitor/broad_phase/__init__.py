"""Broad phase: pairs whose bounds overlap, by grids and trees, with brute force as the reference."""
