"""Convex hulls by Qhull. SciPy is imported at the first call, as its import takes a sixth of the start-up time."""

from __future__ import annotations

from functools import cached_property
from math import inf
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from collision_monitor.geometry.point_tree import PointTree
from collision_monitor.tolerances import HULL_DROP

Array = NDArray[np.float64]

HEIGHTS_AT_ONCE: Final = 1 << 20
"""Heights of points above planes computed in one batch: 8 MB."""

THIN: Final = 1e-9
"""Least distance of the middle of the points from the faces, as part of the size, for a polar hull. Larger: the points
of thin hulls are compared with all faces, in quadratic time. Smaller: corners of the polar hull are round-off."""


def qhull(points: Array) -> Any | None:
    """Hull of points (n, d) as scipy.spatial.ConvexHull, or None if Qhull fails because they are flat."""
    from scipy.spatial import ConvexHull, QhullError

    try:
        return ConvexHull(points)
    except QhullError:
        return None


def hull_vertices(points: Array) -> NDArray[np.int32]:
    """Indices of the points (n, 3) that span their convex hull, ascending; all distinct points if Qhull fails."""
    return QhullResult(points).vertices


class QhullResult:
    """Convex hull of points (n, 3), n >= 1, in m.

    vertices: indices of the points that span it, ascending; all distinct points if Qhull fails.
    """

    vertices: NDArray[np.int32]
    _hull: Any

    def __init__(self, points: Array) -> None:
        _, first = np.unique(points, axis=0, return_index=True)
        first = np.sort(first)
        self._centre = points[first].mean(axis=0)
        centred = points[first] - self._centre
        self._scale = float(np.abs(centred).max())
        self._hull = hull = qhull(centred / self._scale)
        if hull is None:
            self.vertices = first.astype(np.int32)
            return
        # Qhull merges nearly coplanar points; keep a vertex that it dropped although it is outside the hull
        keep = np.zeros(len(first), bool)
        keep[hull.vertices] = True
        normal, offset = hull.equations[:, :3], hull.equations[:, 3]
        rest = np.flatnonzero(~keep)
        if len(rest) * len(normal) > HEIGHTS_AT_ONCE:  # most are far inside
            rest = rest[self._beyond(centred[rest] / self._scale, HULL_DROP / 2)]
        for some in np.array_split(rest, len(rest) * len(normal) // HEIGHTS_AT_ONCE + 1):
            outside = (centred[some] / self._scale) @ normal.T + offset
            keep[some] = outside.max(axis=1, initial=-inf) > HULL_DROP
        self.vertices = first[keep].astype(np.int32)

    def beyond(self, points: Array, limit: float) -> NDArray[np.bool_]:
        """Whether points (m, 3) are farther than a limit >= 0 (m) outside of the plane of a face.

        False if Qhull failed. A point that is farther than the limit from the hull may be nearer to all planes.
        """
        if self._hull is None:
            return np.zeros(len(points), bool)
        return self._beyond((points - self._centre) / self._scale, limit / self._scale)

    def _beyond(self, points: Array, limit: float) -> NDArray[np.bool_]:
        """As `beyond`, with points and limit in the units of Qhull, which did not fail."""
        if self._planes is None:
            normal, offset = self._hull.equations[:, :3], self._hull.equations[:, 3]
            parts = np.array_split(points, len(points) * len(normal) // HEIGHTS_AT_ONCE + 1)
            return np.concatenate([(some @ normal.T + offset > limit).any(axis=1) for some in parts])
        tree, equations = self._planes
        # n . p + e > limit means that n / -e, a corner of the polar hull, has a product with p above 1 + limit / -e
        cut = 1.0 + limit / float(-equations[:, 3].min())
        return tree.exceeds(points, np.full(len(points), cut), equations, np.full(len(points), limit))

    @cached_property
    def _planes(self) -> tuple[PointTree, Array] | None:
        """Tree over the corners of the polar hull, and the equations (k, 4) of the faces that they stand for.

        None if the middle of the points is in a face, up to round-off.
        """
        _, first = np.unique(self._hull.equations, axis=0, return_index=True)  # the parts of a face have one plane
        equations = self._hull.equations[first]
        if not (equations[:, 3] < -THIN).all():
            return None
        middle = self._hull.points[self._hull.simplices[first]].mean(axis=1)  # about normal to the polar hull
        return PointTree(equations[:, :3] / -equations[:, 3:], middle), equations
