"""Readers of mesh files, one file a format: bytes in, vertices and triangles out, or what is wrong with the bytes."""
