"""Simple polygons in the plane: orientation, three tests for convexity, and a test for simplicity.

A polygon is its corners (n, 2) in order around the boundary, in either orientation. A repeated corner counts once.
(Slides "Convex Polygon", "Test for Convex Polygons", "Convex and concave – line test", "interior angles")
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from collision_monitor.errors import ShapeError
from collision_monitor.geometry.coordinates import Array, Indices, point_set
from collision_monitor.geometry.lines import Relation, intersect
from collision_monitor.geometry.orientation import segments_cross
from collision_monitor.geometry.point_in_polygon import Location, locate_in_polygon
from collision_monitor.geometry.points import closest_point_on_segment, point_distance
from collision_monitor.tolerances import EPSILON


def polygon_corners(points: ArrayLike) -> Indices:
    """Indices of the corners of a polygon (n, 2) that differ from the one before. Raises ShapeError if fewer than 3."""
    polygon = point_set(points, "polygon", 2, least=3)
    kept = np.flatnonzero((polygon != np.roll(polygon, 1, axis=0)).any(axis=1))
    if len(kept) < 3:
        raise ShapeError(f"polygon: expected at least 3 different corners, got {polygon.tolist()!r:.200}")
    return kept


def signed_area(points: ArrayLike) -> float:
    """Area (m²), positive if the corners are counter-clockwise. (Shoelace formula)"""
    polygon = point_set(points, "polygon", 2, least=3)
    offset = polygon - polygon[0]  # far from the origin the products would cancel
    following = np.roll(offset, -1, axis=0)
    return float(0.5 * (offset[:, 0] * following[:, 1] - offset[:, 1] * following[:, 0]).sum())


def is_counter_clockwise(points: ArrayLike) -> bool:
    """Whether the corners of a simple polygon (n, 2) are counter-clockwise, exactly, by its lowest leftmost corner."""
    polygon = point_set(points, "polygon", 2, least=3)
    polygon = polygon[polygon_corners(polygon)]
    return bool(corner_turns(polygon)[np.lexsort((polygon[:, 1], polygon[:, 0]))[0]] > 0.0)


def corner_turns(points: ArrayLike) -> Array:
    """Cross products (n,) of the edges at each corner: positive for a left turn, 0 for straight on, exact in sign."""
    polygon = point_set(points, "polygon", 2, least=3)
    before, after = np.roll(polygon, 1, axis=0), np.roll(polygon, -1, axis=0)
    return np.asarray(segments_cross(before, polygon, polygon, after))


def is_convex(points: ArrayLike) -> bool:
    """Whether a polygon is convex: all cross products have one sign, and the boundary winds around once.

    (Slide "Test for Convex Polygons"; by the signs alone a pentagram would pass.) Straight corners are allowed.
    Raises ShapeError if all corners are on one line.
    """
    polygon = point_set(points, "polygon", 2, least=3)
    polygon = polygon[polygon_corners(polygon)]
    sign = np.sign(corner_turns(polygon))
    if not sign.any():
        raise ShapeError("polygon: expected an area, got corners on one line")
    # on a single winding, the edges' direction changes from leftward to rightward and back exactly once
    edges = np.roll(polygon, -1, axis=0) - polygon
    rightward = (edges[:, 0] > 0.0) | ((edges[:, 0] == 0.0) & (edges[:, 1] > 0.0))
    changes = int((rightward != np.roll(rightward, 1)).sum())
    return not (sign.min() < 0 < sign.max()) and changes == 2


def interior_angles(points: ArrayLike) -> Array:
    """Interior angles (n,) in rad, 0 … 2 pi, of a simple polygon; convex if none is above pi. Their sum is (n - 2) pi.

    (Slide "Convex and concave – interior angles"). Raises ShapeError if a corner is repeated.
    """
    polygon = point_set(points, "polygon", 2, least=3)
    if len(polygon_corners(polygon)) < len(polygon):
        raise ShapeError("polygon: expected different neighbouring corners, got an edge without length")
    arriving = polygon - np.roll(polygon, 1, axis=0)
    leaving = np.roll(arriving, -1, axis=0)
    turning = np.arctan2(corner_turns(polygon), (arriving * leaving).sum(axis=1))
    return np.asarray(np.pi - (turning if is_counter_clockwise(polygon) else -turning))


def passes_line_test(points: ArrayLike) -> bool:
    """Whether each segment between two points of a simple polygon stays in it. (Slide "Convex and concave – line test")

    It is sufficient to test the midpoint of each two corners: the hull of a concave polygon has an edge that is not an
    edge of the polygon, and the middle of that edge is outside. The midpoint is rounded, so a dent shallower than 1e-15
    of the size passes; the exact test is `is_convex`.
    """
    polygon = point_set(points, "polygon", 2, least=3)
    polygon = polygon[polygon_corners(polygon)]
    i, j = np.triu_indices(len(polygon), 1)
    middle = 0.5 * polygon[i] + 0.5 * polygon[j]
    outside = middle[locate_in_polygon(middle, polygon) == Location.OUTSIDE]
    if not len(outside):
        return True
    on_edge, _ = closest_point_on_segment(outside[:, None], polygon[None], np.roll(polygon, -1, axis=0)[None])
    away = point_distance(outside[:, None], on_edge).min(axis=1)
    return bool((away <= 4 * EPSILON * np.abs(polygon).max()).all())


def crossing_edges(points: ArrayLike) -> tuple[int, int] | None:
    """The first two edges (by the index of their first corner) that make a polygon non-simple; None if it is simple.

    Neighbouring edges may share only their common corner, other edges nothing. Exact.
    """
    polygon = point_set(points, "polygon", 2, least=3)
    index = polygon_corners(polygon)
    start = polygon[index]
    end = np.roll(start, -1, axis=0)
    n = len(start)
    i, j = np.triu_indices(n, 1)
    low, high = np.minimum(start, end), np.maximum(start, end)
    near = ((low[i] <= high[j]) & (low[j] <= high[i])).all(axis=1)
    i, j = i[near], j[near]
    neighbours = (j - i == 1) | (j - i == n - 1)
    relation = intersect(start[i], end[i], start[j], end[j]).relation
    bad = np.flatnonzero(relation != np.where(neighbours, Relation.POINT, Relation.NONE))
    return (int(index[i[bad[0]]]), int(index[j[bad[0]]])) if len(bad) else None


def is_simple(points: ArrayLike) -> bool:
    """Whether no two edges of a polygon have more in common than the corner between neighbours."""
    return crossing_edges(points) is None
