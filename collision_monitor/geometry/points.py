"""Tests of points against points, segments, the ground and planes."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from collision_monitor.checks.numbers import checked_array
from collision_monitor.errors import ShapeError
from collision_monitor.geometry.coordinates import Array, Booleans, coordinates
from collision_monitor.geometry.orientation import orient2d
from collision_monitor.tolerances import EPSILON


def point_distance(p: ArrayLike, q: ArrayLike) -> Array:
    """Distances (m) of points (..., 2 or 3)."""
    return np.asarray(np.linalg.norm(coordinates(q, "q") - coordinates(p, "p"), axis=-1))


def points_coincide(p: ArrayLike, q: ArrayLike, threshold: float = 0.0) -> Booleans:
    """Whether points (..., 2 or 3) are within `threshold` (m) of each other. (Slide "Generic collision detection test")

    Uses the distance, because the slide's comparison per coordinate lacks the absolute value and accepts distant
    points.
    """
    return np.asarray(point_distance(p, q) <= checked_array(threshold, "threshold", least=0.0))


def closest_point_on_segment(p: ArrayLike, a: ArrayLike, b: ArrayLike) -> tuple[Array, Array]:
    """Points of segments a, b (..., 2 or 3) closest to p, and their parameters t (...) from 0 at a to 1 at b."""
    p, a, b = coordinates(p, "p"), coordinates(a, "a"), coordinates(b, "b")
    along = b - a
    length2 = (along * along).sum(axis=-1)
    t = ((p - a) * along).sum(axis=-1) / np.where(length2 > 0.0, length2, 1.0)
    t = np.clip(np.where(length2 > 0.0, t, 0.0), 0.0, 1.0)
    # from the nearer end, as the round-off of a whole segment length would spoil points close to b
    near_b = (t > 0.5)[..., None]
    point = np.where(near_b, b - (1.0 - t)[..., None] * along, a + t[..., None] * along)
    return point, t


def point_on_segment(p: ArrayLike, a: ArrayLike, b: ArrayLike, tolerance: float = 0.0) -> Booleans:
    """Whether p lies on the segments a, b (..., 2 or 3), ends included. (Slide "Point on a line segment")

    The slide's t_x = t_y divides by zero on axis-parallel segments and fails by round-off. Here t_x = t_y is tested as
    an exact zero cross product for each pair of coordinates, and 0 <= t <= 1 as p within the segment's box.
    With a tolerance (m), the test is whether p is within that distance of the segment.
    """
    p, a, b = coordinates(p, "p"), coordinates(a, "a"), coordinates(b, "b")
    if checked_array(tolerance, "tolerance", least=0.0) > 0.0:
        return points_coincide(p, closest_point_on_segment(p, a, b)[0], tolerance)
    result = ((np.minimum(a, b) <= p) & (p <= np.maximum(a, b))).all(axis=-1)
    for pair in ([0, 1], [1, 2], [2, 0])[: 1 if p.shape[-1] == 2 else 3]:
        result = result & (orient2d(a[..., pair], b[..., pair], p[..., pair]) == 0.0)
    return np.asarray(result)


def height_above_ground(p: ArrayLike, ground: ArrayLike = 0.0) -> Array:
    """Heights (m) of points (..., 3) above z = ground; a collision if <= 0. (Slide "point-ground plane")"""
    return np.asarray(coordinates(p, "p", 3)[..., 2] - checked_array(ground, "ground"))


class Plane(NamedTuple):
    """Planes by a unit normal (..., 3) and a point on them (..., 3) in m.

    They store a point instead of the slides' d, because differences of positions keep their digits far from the origin.
    """

    normal: Array
    point: Array

    @property
    def d(self) -> Array:
        """The d (m) of a x + b y + c z + d = 0, where (a, b, c) is the normal."""
        return np.asarray(-(self.normal * self.point).sum(axis=-1))


def plane(normal: ArrayLike, point: ArrayLike) -> Plane:
    """Planes through points (..., 3) with normals (..., 3) of any length but zero. Raises ShapeError."""
    normal = coordinates(normal, "normal", 3)
    scale = np.abs(normal).max(axis=-1, keepdims=True)
    if not scale.all():
        raise ShapeError("plane: expected normals with a direction, got a zero vector")
    normal = normal / scale
    return Plane(normal / np.linalg.norm(normal, axis=-1, keepdims=True), coordinates(point, "point", 3))


def plane_from_points(p1: ArrayLike, p2: ArrayLike, p3: ArrayLike) -> Plane:
    """Planes through three points (..., 3); p1, p2, p3 are counter-clockwise seen from the side of the normal.

    (Slide "Vertex - Face collision"; its n = s x r points to the other side, away from the outside of a face.)
    Raises ShapeError if the points lie on one line.
    """
    p1, p2, p3 = coordinates(p1, "p1", 3), coordinates(p2, "p2", 3), coordinates(p3, "p3", 3)
    r, s = p1 - p3, p2 - p3
    size = np.maximum(np.abs(r).max(axis=-1), np.abs(s).max(axis=-1))[..., None]
    r, s = r / np.where(size > 0.0, size, 1.0), s / np.where(size > 0.0, size, 1.0)
    n = np.cross(r, s)
    noise = 8 * EPSILON * np.linalg.norm(r, axis=-1) * np.linalg.norm(s, axis=-1)
    if (np.linalg.norm(n, axis=-1) <= noise).any():
        raise ShapeError("plane: expected three points that span a plane, got points on one line")
    return plane(n, p3)


def signed_distance(p: ArrayLike, to: Plane) -> Array:
    """Signed distances (m) of points (..., 3) to planes, positive on the normal's side; a collision if <= 0.

    (Slides "Vertex - Face collision", "point-arbitrary plane")
    """
    return np.asarray(((coordinates(p, "p", 3) - to.point) * to.normal).sum(axis=-1))


def crossing_time(start: ArrayLike, end: ArrayLike, through: Plane) -> Array:
    """Fraction t (...) in 0 … 1 at which points moving from start to end (..., 3) first meet planes, else NaN.

    The result is 0 if the point starts on the plane. (Slide "Collision detection: time of impact": E(p) = 0 on the
    segment from P(t_i) to P(t_i+1). E is linear along it, so the crossing is computed directly instead of by sampling.)
    """
    before, after = signed_distance(start, through), signed_distance(end, through)
    crosses = (np.sign(before) * np.sign(after) <= 0.0) & ((before != 0.0) | (after != 0.0))
    change = np.where(crosses, before - after, 1.0)
    return np.where(before == 0.0, 0.0, np.where(crosses, before / change, np.nan))
