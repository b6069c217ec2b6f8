"""Closest point of a triangle to a point."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from collision_monitor.geometry.coordinates import Array, coordinates
from collision_monitor.geometry.points import closest_point_on_segment


def closest_point_on_triangle(p: ArrayLike, a: ArrayLike, b: ArrayLike, c: ArrayLike) -> tuple[Array, Array]:
    """Points of triangles a, b, c (..., 3) closest to p (..., 3), and their distances (...), in m.

    The result is the foot on the plane if it is inside all sides, else the nearest point of the sides. A triangle
    without area therefore consists of its sides. (Ericson, Real-Time Collision Detection, 5.1.5)
    """
    p, a, b, c = np.broadcast_arrays(
        coordinates(p, "p", 3), coordinates(a, "a", 3), coordinates(b, "b", 3), coordinates(c, "c", 3)
    )
    normal = np.cross(b - a, c - a)
    length2 = (normal * normal).sum(axis=-1)
    inside = length2 > 0.0
    for u, v in ((a, b), (b, c), (c, a)):
        inside = inside & ((np.cross(v - u, p - u) * normal).sum(axis=-1) >= 0.0)
    height = ((p - a) * normal).sum(axis=-1) / np.where(inside, length2, 1.0)
    sides = np.stack([closest_point_on_segment(p, u, v)[0] for u, v in ((a, b), (b, c), (c, a))])
    nearest = ((sides - p) ** 2).sum(axis=-1).argmin(axis=0)
    on_side = np.take_along_axis(sides, nearest[None, ..., None], axis=0)[0]
    point = np.where(inside[..., None], p - height[..., None] * normal, on_side)
    return point, np.asarray(np.linalg.norm(point - p, axis=-1))
