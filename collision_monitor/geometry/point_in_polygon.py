"""Point in polygon: ray parity for any simple polygon, the sided test for convex ones. Both are exact."""

from __future__ import annotations

from enum import IntEnum

import numpy as np
from numpy.typing import ArrayLike

from collision_monitor.geometry.coordinates import Signs, coordinates, point_set
from collision_monitor.geometry.orientation import orient2d


class Location(IntEnum):
    """Location of a point relative to a polygon or a polyhedron."""

    OUTSIDE = -1
    BOUNDARY = 0
    INSIDE = 1


def locate_in_polygon(points: ArrayLike, polygon: ArrayLike) -> Signs:
    """Location (...) of points (..., 2) in a simple polygon (n, 2), by the parity of a ray towards +x.

    (Slides "Point in polygon – ray test", "Ray test special cases".) The special cases need no epsilon:
    an edge includes its lower end and excludes its upper one, so a ray through a corner counts once if the boundary
    passes through and twice or never if it only touches; an edge along the ray has no lower end and never counts;
    a point on the boundary is found beforehand by its exact cross product.
    """
    p = coordinates(points, "points", 2)[..., None, :]
    a = point_set(polygon, "polygon", 2, least=3)
    b = np.roll(a, -1, axis=0)
    x, y = p[..., 0], p[..., 1]
    # an edge matters if the ray's line reaches it and it is not entirely to the left
    level = (np.minimum(a[:, 1], b[:, 1]) <= y) & (y <= np.maximum(a[:, 1], b[:, 1]))
    matters = level & (x <= np.maximum(a[:, 0], b[:, 0]))
    at = np.nonzero(matters)
    side = np.zeros(matters.shape)
    shape = (*matters.shape, 2)
    side[at] = orient2d(np.broadcast_to(a, shape)[at], np.broadcast_to(b, shape)[at], np.broadcast_to(p, shape)[at])
    on_edge = matters & (side == 0.0) & (np.minimum(a[:, 0], b[:, 0]) <= x)
    upward = (a[:, 1] <= y) & (y < b[:, 1])
    downward = (b[:, 1] <= y) & (y < a[:, 1])
    crossed = matters & ((upward & (side > 0.0)) | (downward & (side < 0.0)))
    odd = crossed.sum(axis=-1) % 2 == 1
    inside = np.where(odd, Location.INSIDE, Location.OUTSIDE)
    return np.where(on_edge.any(axis=-1), Location.BOUNDARY, inside).astype(np.int8)


def locate_in_convex(points: ArrayLike, polygon: ArrayLike) -> Signs:
    """Location (...) of points (..., 2) in a convex polygon (n, 2) of either orientation: on one side of all edges.

    (Slide "Point in convex polygon", the sided test)
    """
    p = coordinates(points, "points", 2)[..., None, :]
    a = point_set(polygon, "polygon", 2, least=3)
    b = np.roll(a, -1, axis=0)
    edge = (a != b).any(axis=1)
    side = np.sign(orient2d(a[edge], b[edge], p))
    return np.maximum(side.min(axis=-1), -side.max(axis=-1)).astype(np.int8)
