"""Support function of any shape, in NumPy: how far it extends in a direction."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from collision_monitor.errors import UnsupportedError
from collision_monitor.shapes.pose import Pose
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
    Triangle,
)
from collision_monitor.tolerances import HULL_DROP

Array = NDArray[np.float64]


def reach(pieces: Sequence[tuple[Shape, Pose]], directions: ArrayLike) -> Array:
    """Greatest d . x (...) in m over all pieces, for unit directions d (..., 3); inf if unbounded."""
    d = np.asarray(directions, dtype=np.float64)
    each = [d @ pose.position + _reach(shape, d @ pose.rotation) for shape, pose in pieces]
    return np.asarray(np.max(each, axis=0))


def _reach(shape: Shape, d: Array) -> Array:
    """Support function of one shape in its own frame."""
    along, rim = np.abs(d[..., 2]), np.hypot(d[..., 0], d[..., 1])
    match shape:
        case Sphere():
            return np.full(d.shape[:-1], shape.radius)
        case Box():
            return np.asarray(np.abs(d) @ (np.array(shape.size) / 2))
        case Capsule():
            return np.asarray(along * shape.length / 2 + shape.radius)
        case Cylinder():
            return np.asarray(along * shape.length / 2 + shape.radius * rim)
        case Cone():
            height = d[..., 2] * shape.length / 2
            return np.asarray(np.maximum(height, shape.radius * rim - height))
        case Ellipsoid():
            return np.asarray(np.linalg.norm(d * shape.radii, axis=-1))
        case ConvexHull() | Triangle():
            return np.asarray((d @ shape.points.T).max(axis=-1))
        case Mesh():
            return np.asarray((d @ shape.vertices[np.unique(shape.faces)].T).max(axis=-1))
        case Points():
            return np.asarray((d @ shape.points.T).max(axis=-1) + shape.radius)
        case HalfSpace():
            return np.where(d @ shape.normal >= 1.0 - HULL_DROP, shape.offset, np.inf)
        case Circle():
            return np.asarray(shape.radius * rim)
        case Polygon():
            return np.asarray((d[..., :2] @ shape.points.T).max(axis=-1) + shape.radius * rim)
    raise UnsupportedError(f"{type(shape).__name__} has no support function")
