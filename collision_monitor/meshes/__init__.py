"""Trees over triangles and points: build, distance, overlap, touching triangles, first impact."""
