"""Motions of bodies, and predictions of their contacts."""
