"""Shapes: what they are, their poses, their table, the meshes of files."""
