"""Rigid bodies of the scenes, and how they respond when they meet."""
