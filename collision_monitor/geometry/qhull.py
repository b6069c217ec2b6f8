"""Convex hulls by Qhull. SciPy is imported at the first call, as its import takes a sixth of the start-up time."""

from __future__ import annotations

from math import inf
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from collision_monitor.tolerances import HULL_DROP

Array = NDArray[np.float64]

HEIGHTS_AT_ONCE: Final = 1 << 20
"""Heights of points above planes computed in one batch: 8 MB."""


def qhull(points: Array) -> Any | None:
    """Hull of points (n, d) as scipy.spatial.ConvexHull, or None if Qhull fails because they are flat."""
    from scipy.spatial import ConvexHull, QhullError

    try:
        return ConvexHull(points)
    except QhullError:
        return None


def hull_vertices(points: Array) -> NDArray[np.int32]:
    """Indices of the points (n, 3) that span their convex hull, ascending; all distinct points if Qhull fails."""
    _, first = np.unique(points, axis=0, return_index=True)
    first = np.sort(first)
    centred = points[first] - points[first].mean(axis=0)
    scale = float(np.abs(centred).max())
    hull = qhull(centred / scale)
    if hull is None:
        return first.astype(np.int32)
    # Qhull merges nearly coplanar points; keep a vertex that it dropped although it is outside the hull
    keep = np.zeros(len(first), bool)
    keep[hull.vertices] = True
    normal, offset = hull.equations[:, :3], hull.equations[:, 3]
    rest = np.flatnonzero(~keep)
    for some in np.array_split(rest, len(rest) * len(normal) // HEIGHTS_AT_ONCE + 1):
        outside = (centred[some] / scale) @ normal.T + offset
        keep[some] = outside.max(axis=1, initial=-inf) > HULL_DROP
    return first[keep].astype(np.int32)
