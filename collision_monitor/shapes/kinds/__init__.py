"""The kinds of shapes, one file each; the file is named after its class, as truncated_cone.py after TruncatedCone."""
