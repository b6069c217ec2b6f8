"""Shapes, poses, bounding volumes and feature tests: pure functions on arrays."""
