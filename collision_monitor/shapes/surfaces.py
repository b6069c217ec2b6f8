"""Coarse triangles of shapes, only for display. No answer depends on them."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from collision_monitor.geometry.qhull import qhull
from collision_monitor.shapes.shapes import (
    Box,
    Capsule,
    Circle,
    Cone,
    ConvexHull,
    Cylinder,
    Ellipsoid,
    HalfSpace,
    Mesh,
    Points,
    Polygon,
    Shape,
    Sphere,
)

Triangles = NDArray[np.float64]
"""(n, 3, 3): triangle, corner, coordinate in m."""

MOST_POINTS = 5000
"""Points of a hull or a cloud that is drawn, which takes up to 50 ms. A larger hull, or one too flat for Qhull, appears
as its box; of a larger cloud, some points appear."""
SIDES = 16
"""Number of sides of a round shape."""
HALF_SPACE_EXTENT = 20.0
"""Side of the square that represents an infinite plane (m)."""


def surface_triangles(shape: Shape) -> Triangles:
    """Return the surface of a shape in its own frame."""
    match shape:
        case Box():
            return _box(shape.corners)
        case Sphere():
            angles = np.linspace(-np.pi / 2, np.pi / 2, SIDES // 2 + 1)
            return _revolve(shape.radius * np.cos(angles), shape.radius * np.sin(angles))
        case Capsule():
            angles = np.linspace(0.0, np.pi / 2, SIDES // 4 + 1)
            radii, heights = shape.radius * np.cos(angles), shape.radius * np.sin(angles) + shape.length / 2
            return _revolve(np.r_[radii[::-1], radii], np.r_[-heights[::-1], heights])
        case Cylinder():
            h = shape.length / 2
            return _revolve(np.array([0.0, shape.radius, shape.radius, 0.0]), np.array([-h, -h, h, h]))
        case Cone():
            h = shape.length / 2
            return _revolve(np.array([0.0, shape.radius, 0.0]), np.array([-h, -h, h]))
        case Ellipsoid():
            angles = np.linspace(-np.pi / 2, np.pi / 2, SIDES // 2 + 1)
            return np.asarray(_revolve(np.cos(angles), np.sin(angles)) * shape.radii)
        case Circle():
            return _revolve(np.array([0.0, shape.radius]), np.zeros(2))
        case Mesh():
            corners: Triangles = np.asarray(shape.vertices)[np.asarray(shape.faces)]
            return corners
        case Points():
            return _tetrahedra(np.asarray(shape.points), shape.radius)
        case ConvexHull():
            return _hull(np.asarray(shape.points))
        case Polygon():
            turn = np.linspace(0.0, 2 * np.pi, SIDES, endpoint=False)
            corner = shape.radius * np.stack([np.cos(turn), np.sin(turn)], axis=1)
            rounded = shape.points if shape.radius else shape.points[:0]
            return np.concatenate([_outline(ring) for ring in (shape.points, *(at + corner for at in rounded))])
        case HalfSpace():
            return _plane(np.asarray(shape.normal), shape.offset)
    raise TypeError(f"no surface for {type(shape).__name__}")


def _revolve(radii: NDArray[np.float64], heights: NDArray[np.float64]) -> Triangles:
    """Rotate the profile (radius, height) about z."""
    turn = np.linspace(0.0, 2 * np.pi, SIDES + 1)
    ring = np.stack([np.cos(turn), np.sin(turn)], axis=1)
    rings = np.empty((len(radii), SIDES + 1, 3))
    rings[:, :, :2] = radii[:, None, None] * ring
    rings[:, :, 2] = heights[:, None]
    low, high = rings[:-1], rings[1:]
    a, b, c, d = low[:, :-1], low[:, 1:], high[:, 1:], high[:, :-1]
    return np.concatenate([np.stack([a, b, c], axis=2), np.stack([a, c, d], axis=2)]).reshape(-1, 3, 3)


def _box(corner: NDArray[np.float64]) -> Triangles:
    quads = [[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]]
    return np.array([corner[[q[0], q[i], q[i + 1]]] for q in quads for i in (1, 2)])


def _hull(points: NDArray[np.float64]) -> Triangles:
    hull = qhull(points) if len(points) <= MOST_POINTS else None
    if hull is None:
        low, high = points.min(axis=0), points.max(axis=0)
        return _box(Box((1.0, 1.0, 1.0)).corners * (high - low) + 0.5 * (low + high))
    corners: Triangles = points[hull.simplices]
    return corners


def _tetrahedra(points: NDArray[np.float64], radius: float) -> Triangles:
    """Return a tetrahedron at each point; at every k-th one if there are more than MOST_POINTS."""
    some = points[:: -(-len(points) // MOST_POINTS)]
    size = radius or 1e-3 * float(np.abs(points).max())
    corner = size * np.array([(1.0, 1.0, 1.0), (1.0, -1.0, -1.0), (-1.0, 1.0, -1.0), (-1.0, -1.0, 1.0)]) / np.sqrt(3.0)
    faces = corner[[(0, 1, 2), (0, 3, 1), (0, 2, 3), (1, 3, 2)]]
    return np.asarray((some[:, None, None] + faces).reshape(-1, 3, 3))


def _outline(points: NDArray[np.float64]) -> Triangles:
    """Return a thin upright band along the boundary, which is right for concave polygons too."""
    a = np.c_[points, np.zeros(len(points))]
    b = np.roll(a, -1, axis=0)
    up = np.array([0.0, 0.0, 0.1])
    return np.concatenate([np.stack([a, b, b + up], axis=1), np.stack([a, b + up, a + up], axis=1)])


def _plane(normal: NDArray[np.float64], offset: float) -> Triangles:
    helper = np.eye(3)[np.argmin(np.abs(normal))]
    u = np.cross(normal, helper)
    u *= HALF_SPACE_EXTENT / 2 / np.linalg.norm(u)
    v = np.cross(normal, u)
    centre = normal * offset
    a, b, c, d = centre - u - v, centre + u - v, centre + u + v, centre - u + v
    return np.array([[a, b, c], [a, c, d]])
