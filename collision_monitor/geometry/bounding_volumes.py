"""Bounding volumes of a set of points: their types, and the construction of AABB, k-DOP and convex hull.

Each volume contains every point of its set, also in floating point, as sizes are rounded outward. (The hull is accurate
to Qhull's 1e-14.) The fields may have leading dimensions, so that one tuple is an array of volumes.
(Slides "Bounding objects", "Bounding volume construction". Others: bounding_spheres.py, oriented_boxes.py)
"""

from __future__ import annotations

from itertools import product
from math import pi
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from collision_monitor.errors import InputError, ShapeError
from collision_monitor.geometry.coordinates import Array, Indices, coordinates, point_set
from collision_monitor.geometry.orientation import orient3d
from collision_monitor.geometry.qhull import qhull
from collision_monitor.tolerances import EPSILON


class Aabb(NamedTuple):
    """Axis-aligned bounding box: lower and upper corner (..., 2 or 3) in m."""

    lower: Array
    upper: Array

    @property
    def volume(self) -> Array:
        """Volume in m³, or area in m² in the plane."""
        return np.asarray((self.upper - self.lower).prod(axis=-1))


class BoundingSphere(NamedTuple):
    """Bounding sphere, or circle in the plane: center (..., 2 or 3) and radius (...) in m."""

    center: Array
    radius: Array

    @property
    def volume(self) -> Array:
        """Volume in m³, or area in m² in the plane."""
        return np.asarray(4 / 3 * pi * self.radius**3 if self.center.shape[-1] == 3 else pi * self.radius**2)


class Obb(NamedTuple):
    """Oriented bounding box: center (..., 3) (m), R_WB (..., 3, 3), half extents (..., 3) along its columns (m)."""

    center: Array
    rotation: Array
    half_extents: Array

    @property
    def volume(self) -> Array:
        """Volume in m³."""
        return np.asarray((2 * self.half_extents).prod(axis=-1))

    @property
    def corners(self) -> Array:
        """Eight corners (..., 8, 3) in m."""
        signs = np.array(list(product((-1.0, 1.0), repeat=3)))
        return np.asarray(
            self.center[..., None, :] + (signs * self.half_extents[..., None, :]) @ np.swapaxes(self.rotation, -1, -2)
        )


class Kdop(NamedTuple):
    """k-DOP: lower <= direction . x <= upper; unit directions (k/2, 3), bounds (..., k/2) in m."""

    directions: Array
    lower: Array
    upper: Array


class Hull(NamedTuple):
    """Convex hull: its corners (n, 3) in m and triangles (m, 3), counter-clockwise from outside."""

    vertices: Array
    faces: Indices

    @property
    def volume(self) -> float:
        """Volume in m³."""
        a, b, c = (self.vertices - self.vertices.mean(axis=0))[self.faces.T]
        return float((a * np.cross(b, c)).sum() / 6)


def aabb(points: ArrayLike) -> Aabb:
    """Axis-aligned box of points (n, 2 or 3): least and greatest coordinates. (Slide "Axis aligned bounding box")"""
    points = point_set(points, "points")
    return Aabb(points.min(axis=0), points.max(axis=0))


_FACES: Final = [(1, 0, 0), (0, 1, 0), (0, 0, 1)]
_CORNERS: Final = [(1, 1, 1), (1, 1, -1), (1, -1, 1), (1, -1, -1)]
_EDGES: Final = [(1, 1, 0), (1, -1, 0), (1, 0, 1), (1, 0, -1), (0, 1, 1), (0, 1, -1)]

KDOP_DIRECTIONS: Final = {6: _FACES, 14: _FACES + _CORNERS, 18: _FACES + _EDGES, 26: _FACES + _CORNERS + _EDGES}
"""The usual sets of directions by k: normals of a cube's faces, with corners cut off, edges cut off, or both."""


def kdop_of_points(points: ArrayLike, directions: ArrayLike | int = 14) -> Kdop:
    """k-DOP around points (n, 3): k from KDOP_DIRECTIONS, or own directions (k/2, 3) of any length but zero.

    (Slide "Bounding Slabs": "arbitrary (user-specified) collection of bounding plane-pairs"; Klosowski et al., 1998)
    Raises InputError.
    """
    points = point_set(points, "points", 3)
    if isinstance(directions, int):
        if directions not in KDOP_DIRECTIONS:
            raise InputError(f"k-DOP: expected k of {list(KDOP_DIRECTIONS)} or directions (k/2, 3), got {directions}")
        directions = KDOP_DIRECTIONS[directions]
    normals = coordinates(directions, "k-DOP directions", 3).reshape(-1, 3)
    length = np.linalg.norm(normals, axis=1, keepdims=True)
    if not length.all():
        raise InputError("k-DOP directions: expected vectors with a direction, got a zero vector")
    normals = normals / length
    dots = normals @ points.T
    # a dot product has round-off, except along a coordinate axis
    slack = np.where((normals != 0.0).sum(axis=1) > 1, 4 * EPSILON * np.abs(points).max(), 0.0)
    return Kdop(normals, dots.min(axis=1) - slack, dots.max(axis=1) + slack)


def inside_kdop(points: ArrayLike, volume: Kdop) -> Array:
    """Whether points (..., 3) in m are between all pairs of planes. (Slide "Bounding Slabs")"""
    dots = coordinates(points, "points", 3) @ volume.directions.T
    return np.asarray(((volume.lower <= dots) & (dots <= volume.upper)).all(axis=-1))


def convex_hull(points: ArrayLike) -> Hull:
    """Convex hull of points (n, 3) in m, by Qhull. (Slides "Convex Hull": gift wrapping, slower for the same hull)

    Raises ShapeError for points in one plane, which span no volume.
    """
    points = point_set(points, "points", 3, least=4)
    center = 0.5 * points.min(axis=0) + 0.5 * points.max(axis=0)
    size = float(np.abs(points - center).max())
    hull = qhull((points - center) / (size or 1.0))
    if hull is None:
        raise ShapeError("convex hull: expected points that span a solid, got points in one plane")
    used, faces = np.unique(hull.simplices, return_inverse=True)
    vertices, faces = points[used], faces.reshape(-1, 3)
    # Qhull's triangles have no consistent orientation
    inner = center + size * hull.points[hull.vertices].mean(axis=0)
    outward = np.asarray(orient3d(vertices[faces[:, 0]], vertices[faces[:, 1]], vertices[faces[:, 2]], inner)) < 0.0
    faces = np.where(outward[:, None], faces, faces[:, ::-1])
    return Hull(vertices, faces.astype(np.int64))
