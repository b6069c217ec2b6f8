"""The contact of two shapes: distance, overlap, normal, points, features."""
