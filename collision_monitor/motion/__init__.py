"""Motions of bodies: where a body is at a time, and how a body is laid out for the kernels."""
