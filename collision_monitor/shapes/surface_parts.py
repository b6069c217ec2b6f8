"""Coarse triangles of the surfaces that shapes are made of, only for display. No answer depends on them."""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

from collision_monitor.geometry.qhull import qhull

Triangles = NDArray[np.float64]
"""(n, 3, 3): triangle, corner, coordinate in m."""

MOST_POINTS: Final = 5000
"""Points of a hull or a cloud that is drawn, which takes up to 50 ms. A larger hull, or one too flat for Qhull, appears
as its box; of a larger cloud, some points appear."""

SIDES: Final = 16
"""Number of sides of a round shape."""

HALF_SPACE_EXTENT: Final = 20.0
"""Side of the square that represents an infinite plane (m)."""

UNIT_CORNERS: Final = np.array([(x, y, z) for x in (-0.5, 0.5) for y in (-0.5, 0.5) for z in (-0.5, 0.5)])
"""The corners (8, 3) of a box of 1 m."""


def revolved_triangles(radii: NDArray[np.float64], heights: NDArray[np.float64]) -> Triangles:
    """Rotate the profile (radius, height) about z."""
    turn = np.linspace(0.0, 2 * np.pi, SIDES + 1)
    ring = np.stack([np.cos(turn), np.sin(turn)], axis=1)
    rings = np.empty((len(radii), SIDES + 1, 3))
    rings[:, :, :2] = radii[:, None, None] * ring
    rings[:, :, 2] = heights[:, None]
    low, high = rings[:-1], rings[1:]
    a, b, c, d = low[:, :-1], low[:, 1:], high[:, 1:], high[:, :-1]
    return np.concatenate([np.stack([a, b, c], axis=2), np.stack([a, c, d], axis=2)]).reshape(-1, 3, 3)


def box_triangles(corner: NDArray[np.float64]) -> Triangles:
    """Two triangles for each face of a box with these corners (8, 3), ordered as UNIT_CORNERS."""
    quads = [[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]]
    return np.array([corner[[q[0], q[i], q[i + 1]]] for q in quads for i in (1, 2)])


def hull_triangles(points: NDArray[np.float64]) -> Triangles:
    """Faces of the convex hull of points (n, 3)."""
    hull = qhull(points) if len(points) <= MOST_POINTS else None
    if hull is None:
        low, high = points.min(axis=0), points.max(axis=0)
        return box_triangles(UNIT_CORNERS * (high - low) + 0.5 * (low + high))
    corners: Triangles = points[hull.simplices]
    return corners


def cloud_triangles(points: NDArray[np.float64], radius: float) -> Triangles:
    """Return a tetrahedron at each point; at every k-th one if there are more than MOST_POINTS."""
    some = points[:: -(-len(points) // MOST_POINTS)]
    size = radius or 1e-3 * float(np.abs(points).max())
    corner = size * np.array([(1.0, 1.0, 1.0), (1.0, -1.0, -1.0), (-1.0, 1.0, -1.0), (-1.0, -1.0, 1.0)]) / np.sqrt(3.0)
    faces = corner[[(0, 1, 2), (0, 3, 1), (0, 2, 3), (1, 3, 2)]]
    return np.asarray((some[:, None, None] + faces).reshape(-1, 3, 3))


def outline_triangles(points: NDArray[np.float64]) -> Triangles:
    """Return a thin upright band along the boundary, which is right for concave polygons too."""
    a = np.c_[points, np.zeros(len(points))]
    b = np.roll(a, -1, axis=0)
    up = np.array([0.0, 0.0, 0.1])
    return np.concatenate([np.stack([a, b, b + up], axis=1), np.stack([a, b + up, a + up], axis=1)])


def plane_triangles(normal: NDArray[np.float64], offset: float) -> Triangles:
    """A square of the plane n . x = offset."""
    helper = np.eye(3)[np.argmin(np.abs(normal))]
    u = np.cross(normal, helper)
    u *= HALF_SPACE_EXTENT / 2 / np.linalg.norm(u)
    v = np.cross(normal, u)
    centre = normal * offset
    a, b, c, d = centre - u - v, centre + u - v, centre + u + v, centre - u + v
    return np.array([[a, b, c], [a, c, d]])
