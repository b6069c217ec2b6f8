"""Times until which moving boxes and triangles stay apart."""
