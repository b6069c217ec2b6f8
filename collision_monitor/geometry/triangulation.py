"""Division of concave polygons into convex parts: ear clipping, then fewer parts by Hertel–Mehlhorn.

(Slides "Polygon triangulation: split into a set of convex polygons", "SAT: Limitations")
"""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import ArrayLike

from collision_monitor.errors import ShapeError
from collision_monitor.geometry.coordinates import Array, Indices, point_set
from collision_monitor.geometry.orientation import orient2d
from collision_monitor.geometry.polygons import crossing_edges, is_counter_clockwise, polygon_corners

MOST_CORNERS: Final = 2000
"""Corners of a concave polygon. It has that many times as many pairs of edges, which take 0.3 GB, and up to a minute.
"""


def triangulate(points: ArrayLike) -> Indices:
    """Triangles (n - 2, 3) of a simple polygon (n, 2), as counter-clockwise indices of its corners; none is flat.

    Ear clipping: cut off a corner if its triangle contains no other corner, and repeat (Meisters, 1975). O(n²) for n
    corners, O(n³) at worst. A repeated corner is used once. Raises ShapeError if the polygon is not simple or has
    more than MOST_CORNERS.
    """
    polygon = point_set(points, "polygon", 2, least=3)
    if len(polygon) > MOST_CORNERS:
        raise ShapeError(f"polygon: expected at most {MOST_CORNERS} corners if it is concave, got {len(polygon)}")
    crossing = crossing_edges(polygon)
    if crossing is not None:
        i, j = crossing
        raise ShapeError(f"polygon: expected a simple one, but the edges from corners {i} and {j} meet")
    ring = polygon_corners(polygon)
    if not is_counter_clockwise(polygon):
        ring = ring[::-1]
    ears = []
    while len(ring) > 3:  # terminates: each turn removes a corner
        k = _ear(polygon[ring])
        ears.append([ring[k - 1], ring[k], ring[(k + 1) % len(ring)]])
        ring = np.delete(ring, k)
    return np.array([*ears, ring], dtype=np.int64)


def _ear(ring: Array) -> int:
    """First left turn of a counter-clockwise ring with no other corner in its triangle, boundary included."""
    before, after = np.roll(ring, 1, axis=0), np.roll(ring, -1, axis=0)
    turn = np.asarray(orient2d(before, ring, after))
    # the corner of the ring nearest to an ear inside its triangle is always reflex or straight
    inner = np.flatnonzero(turn <= 0.0)
    for k in np.flatnonzero(turn > 0.0):
        others = ring[inner[(inner != (k - 1) % len(ring)) & (inner != (k + 1) % len(ring))]]
        triangle = np.stack([before[k], ring[k], after[k]])
        others = others[((triangle.min(axis=0) <= others) & (others <= triangle.max(axis=0))).all(axis=1)]
        inside = orient2d(triangle, np.roll(triangle, -1, axis=0), others[:, None]) >= 0.0
        if not inside.all(axis=1).any():
            return int(k)
    raise ShapeError("polygon: expected a simple one, got one without an ear")


def convex_parts(points: ArrayLike) -> list[Indices]:
    """Convex parts of a simple polygon (n, 2), as counter-clockwise indices of its corners.

    Triangulates, then drops each diagonal between two parts that are convex together: at most 4 times the minimum
    number of parts (Hertel and Mehlhorn, 1983). Corners may be straight. Raises ShapeError if the polygon is not
    simple.
    """
    polygon = point_set(points, "polygon", 2, least=3)
    parts = {number: [int(i) for i in triangle] for number, triangle in enumerate(triangulate(polygon))}
    owner = {(part[k - 1], part[k]): number for number, part in parts.items() for k in range(3)}
    for i, j in [edge for edge in owner if edge[0] < edge[1] and edge[::-1] in owner]:
        first, second = parts[owner[i, j]], parts[owner[j, i]]
        along = first[first.index(j) :] + first[: first.index(j)]  # j … i
        along += second[second.index(i) + 1 :] + second[: second.index(i)]  # … and from i back to the corner before j
        along = along[: len(along) - 1] if along[-1] == j else along
        if _convex_at(polygon, along, i) and _convex_at(polygon, along, j):
            merged, dropped = owner[i, j], owner[j, i]
            del owner[i, j], owner[j, i], parts[dropped]
            parts[merged] = along
            owner.update({(along[k - 1], along[k]): merged for k in range(len(along))})
    return [np.array(part, dtype=np.int64) for part in parts.values()]


def _convex_at(polygon: Array, part: list[int], corner: int) -> bool:
    k = part.index(corner)
    return bool(orient2d(polygon[part[k - 1]], polygon[corner], polygon[part[(k + 1) % len(part)]]) >= 0.0)
