"""Trees over triangles and points, made once for each shape."""
