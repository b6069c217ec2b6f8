"""Points, lines, polygons, polyhedra and bounding volumes: pure functions on arrays, which know no shapes."""
