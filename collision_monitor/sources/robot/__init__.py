"""Robots and their planning scenes as sources."""
