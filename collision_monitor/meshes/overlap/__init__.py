"""Which triangles of two trees meet, and whether one solid is inside the other."""
