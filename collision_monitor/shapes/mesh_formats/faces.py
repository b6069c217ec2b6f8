"""Polygons to triangles. The files give polygons of any number of corners, in space, convex or not."""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

from collision_monitor.errors import ShapeError
from collision_monitor.geometry.triangulation import triangulate
from collision_monitor.shapes.mesh_formats.raw_mesh import Array, Indices

Booleans = NDArray[np.bool_]

MOST_CORNERS: Final = 10_000
LONGEST_RING: Final = 256
"""Corners of all concave polygons of a file together, and of one of them: their ears are cut off one by one, in
quadratic time. Quadrilaterals do not count."""

_EMPTY: Final = np.zeros((0, 3), np.int64)


def triangles_of(vertices: Array, counts: Indices, corners: Indices) -> Indices:
    """Return the triangles (m, 3) of polygons, whose corners (sum of counts) are indices of vertices (n, 3).

    counts: corners of each polygon. A convex polygon becomes a fan, a concave one by ear clipping in its plane. The
    triangles of each are as counter-clockwise as it is. Raises ShapeError.
    """
    if (counts < 3).any():
        raise ShapeError(f"expected faces of at least 3 corners, got one of {counts.min()}")
    if len(corners) and not (corners.min() >= 0 and corners.max() < len(vertices)):
        raise ShapeError(
            f"expected corners from 1 to {len(vertices)} of the vertices, got the numbers {corners.min() + 1} to "
            f"{corners.max() + 1}"
        )
    begins = np.concatenate([[0], np.cumsum(counts)[:-1]]).astype(np.int64)
    parts: list[tuple[Indices, Indices]] = []  # polygon of each triangle, triangle
    clipped = 0
    for count in np.unique(counts).tolist():
        rows = np.flatnonzero(counts == count)
        rings = corners[begins[rows, None] + np.arange(count)]
        fans = _fans(rings)
        concave = np.flatnonzero(~_are_convex(vertices[rings])) if count > 3 else rows[:0]
        if count == 4:
            fans[concave] = _fans(np.roll(rings[concave], -1, axis=1))  # by its other diagonal
        elif len(concave):
            clipped += count * len(concave)
            if clipped > MOST_CORNERS or count > LONGEST_RING:
                limits = f"at most {LONGEST_RING} corners of a concave face, and {MOST_CORNERS} of all"
                raise ShapeError(f"expected {limits}, got {count}, and {clipped} or more: triangulate the mesh")
            for row in concave:
                fans[row] = _clipped(vertices[rings[row]], rings[row], fans[row])
        parts.append((np.repeat(rows, count - 2), fans.reshape(-1, 3)))
    if not parts:
        return _EMPTY
    order = np.argsort(np.concatenate([polygons for polygons, _ in parts]), kind="stable")
    return np.concatenate([triangles for _, triangles in parts])[order]


def _fans(rings: Indices) -> Indices:
    """Return the triangles (n, k - 2, 3) of polygons (n, k) from their first corners."""
    first = np.broadcast_to(rings[:, :1], (len(rings), rings.shape[1] - 2))
    return np.stack([first, rings[:, 1:-1], rings[:, 2:]], axis=2)


def _are_convex(points: Array) -> Booleans:
    """Return whether the fans of polygons (n, k, 3) turn one way only: no triangle against the polygon's normal."""
    edges = points[:, 1:] - points[:, :1]
    normals = np.cross(edges[:, :-1], edges[:, 1:])
    return np.asarray((normals @ normals.sum(axis=1)[:, :, None] >= 0.0).all(axis=(1, 2)))


def _clipped(points: Array, ring: Indices, fan: Indices) -> Indices:
    """Return the triangles (k - 2, 3) of a concave polygon; its fan if it is not simple in its plane.

    The boundary of the fan is that of the polygon too, so that a closed surface stays closed.
    """
    edges = points[1:] - points[0]
    normal = np.cross(edges[:-1], edges[1:]).sum(axis=0)
    axis = int(np.abs(normal).argmax())
    flat = np.delete(points, axis, axis=1)
    flat = flat if (normal[axis] > 0.0) == (axis != 1) else flat[:, ::-1]  # seen from the side of the normal
    try:
        found = triangulate(flat)
    except ShapeError:
        return fan
    return ring[found] if found.shape == fan.shape else fan
