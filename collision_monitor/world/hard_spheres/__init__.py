"""Event-driven simulation of hard spheres."""
