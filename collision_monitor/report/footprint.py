"""Outlines of objects in the x-y plane, seen from above."""

from __future__ import annotations

from typing import Final

import numpy as np

from collision_monitor.geometry.qhull import qhull
from collision_monitor.objects.description import ObjectDescription
from collision_monitor.session.history.history import Floats
from collision_monitor.shapes.pose import Pose
from collision_monitor.shapes.reach import reach
from collision_monitor.shapes.registry import HalfSpace, Points, Polygon, Shape, kind_of

VIEWING_DIRECTIONS: Final = 64
"""Number of directions in the plane from which round shapes are sampled."""

FAR: Final = 1e4
"""Size to which a half-space is drawn (m). It is larger than any figure."""

_ANGLE: Final = np.linspace(0.0, 2.0 * np.pi, VIEWING_DIRECTIONS, endpoint=False)
_NORMAL: Final = np.stack([np.cos(_ANGLE), np.sin(_ANGLE), np.zeros(VIEWING_DIRECTIONS)], axis=1)


def footprint(described: ObjectDescription, position: Floats, quaternion: Floats) -> list[Floats]:
    """Return the outline (n, 2) in m of each shape of an object. A nearly level half-space (a ground plane) has none.

    Outlines are convex, except those of polygons without a radius.
    """
    pose = Pose(position, quaternion)
    outlines = [_outline(shape, pose @ offset) for shape, offset in described.shapes]
    return [outline for outline in outlines if outline is not None]


def _outline(shape: Shape, pose: Pose) -> Floats | None:
    match shape:
        case HalfSpace():
            return _half_plane(shape, pose)
        case Polygon() if shape.radius == 0.0:
            return _from_above(np.pad(shape.points, ((0, 0), (0, 1))), pose)
        case Points():
            return _hull(shape.points, pose)
    if (corners := kind_of(shape).corners) is not None:
        return _hull(corners(shape), pose)
    return _round(shape, pose)


def _from_above(points: Floats, pose: Pose) -> Floats:
    return np.asarray((points @ pose.rotation.T + pose.position)[:, :2], np.float64)


def _hull(points: Floats, pose: Pose) -> Floats:
    seen = _from_above(points, pose)
    hull = qhull(seen)
    return seen if hull is None else np.asarray(seen[hull.vertices], np.float64)  # None: the points lie on a line


def _round(shape: Shape, pose: Pose) -> Floats:
    """Intersect the tangents of neighbouring directions."""
    far = reach([(shape, Pose((0.0, 0.0, 0.0), pose.quaternion))], _NORMAL)
    after_normal, after = np.roll(_NORMAL, -1, axis=0), np.roll(far, -1)
    area = _NORMAL[:, 0] * after_normal[:, 1] - _NORMAL[:, 1] * after_normal[:, 0]
    x = (far * after_normal[:, 1] - after * _NORMAL[:, 1]) / area
    y = (after * _NORMAL[:, 0] - far * after_normal[:, 0]) / area
    return np.asarray(np.stack([x, y], axis=1) + pose.position[:2], np.float64)


def _half_plane(shape: HalfSpace, pose: Pose) -> Floats | None:
    """Return the section of the half-space {x : n.x <= offset} at the height of its origin, or None if it is level."""
    normal = pose.rotation @ shape.normal
    level = float(np.linalg.norm(normal[:2]))
    if level < 0.1:
        return None
    n = normal[:2] / level
    edge = pose.position[:2] + n * shape.offset / level
    along = np.array([-n[1], n[0]])
    return np.array([edge + FAR * along, edge - FAR * along, edge - FAR * (along + n), edge + FAR * (along - n)])
