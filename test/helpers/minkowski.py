"""Slow oracle: the Minkowski difference of two point sets by qhull, and the distance to its faces."""

from __future__ import annotations

import itertools

import numpy as np
from scipy.spatial import ConvexHull


def rotation(rng: np.random.Generator) -> np.ndarray:
    """Uniformly random rotation (3, 3)."""
    q = rng.normal(size=4)
    x, y, z, w = q / np.linalg.norm(q)
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )


def box_points(size) -> np.ndarray:
    """Corners (8, 3) of a box of full extents `size` (m)."""
    return np.array(list(itertools.product(*[(-s / 2, s / 2) for s in size])))


def _closest_on_triangle(a, b, c) -> np.ndarray:
    """Closest point to the origin: on the face if the origin projects inside, else on the three edges."""
    n = np.cross(b - a, c - a)
    candidates = []
    n2 = n @ n
    if n2 > 0:
        foot = n * (n @ a) / n2
        inside = all(np.cross(q - p, foot - p) @ n >= 0 for p, q in ((a, b), (b, c), (c, a)))
        if inside:
            candidates.append(foot)
    for p, q in ((a, b), (b, c), (c, a)):
        e = q - p
        t = np.clip(-(p @ e) / (e @ e), 0, 1) if e @ e > 0 else 0.0
        candidates.append(p + t * e)
    return min(candidates, key=lambda v: v @ v)


def polytope_signed_distance(points_a: np.ndarray, points_b: np.ndarray) -> float:
    """Signed distance (m) of the hulls of two point sets (n, 3), from every face of the Minkowski difference."""
    difference = (points_b[:, None, :] - points_a[None, :, :]).reshape(-1, 3)
    hull = ConvexHull(difference)
    if (hull.equations[:, 3] <= 0).all():
        return float(hull.equations[:, 3].max())
    return float(
        min(
            np.linalg.norm(_closest_on_triangle(*difference[simplex]))
            for simplex, equation in zip(hull.simplices, hull.equations, strict=True)
            if equation[3] > 0
        )
    )
