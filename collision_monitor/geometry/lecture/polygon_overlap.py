"""Overlap of two polygons: contained vertices and crossing edges for any polygons, SAT for convex ones."""

from __future__ import annotations

from enum import Enum
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from collision_monitor.errors import ShapeError
from collision_monitor.geometry.coordinates import Array, Indices, coordinates, point_set
from collision_monitor.geometry.lines import segments_intersect
from collision_monitor.geometry.orientation import orient2d
from collision_monitor.geometry.point_in_polygon import Location, locate_in_polygon
from collision_monitor.geometry.polygons import is_convex, is_counter_clockwise, polygon_corners
from collision_monitor.tolerances import EPSILON

PARALLEL: Final = 16 * EPSILON
"""Angle (rad) up to which two edges of a polygon share an axis. It decides what is counted, and no answer."""


class Evidence(Enum):
    """Evidence that decided a test of two polygons."""

    SEPARATE = "neither"
    VERTEX_OF_A = "a vertex of A in B"
    VERTEX_OF_B = "a vertex of B in A"
    EDGES = "an edge of A across an edge of B"


def contained_vertices(a: ArrayLike, b: ArrayLike) -> Indices:
    """Indices of the corners of polygon a (n, 2) that are in the simple polygon b or on its boundary, exactly."""
    return np.flatnonzero(locate_in_polygon(point_set(a, "polygon", 2, least=3), b) != Location.OUTSIDE)


def crossing_edge_pairs(a: ArrayLike, b: ArrayLike) -> Indices:
    """Pairs (m, 2) of edges of polygons a and b, by their first corners, that have a point in common, exactly."""
    a, b = point_set(a, "polygon", 2, least=3), point_set(b, "polygon", 2, least=3)
    end_a, end_b = np.roll(a, -1, axis=0), np.roll(b, -1, axis=0)
    low_a, high_a = np.minimum(a, end_a), np.maximum(a, end_a)
    low_b, high_b = np.minimum(b, end_b), np.maximum(b, end_b)
    i, j = np.nonzero(((low_a[:, None] <= high_b) & (low_b <= high_a[:, None])).all(axis=-1))
    if not len(i):
        return np.zeros((0, 2), np.int64)
    meet = segments_intersect(a[i], end_a[i], b[j], end_b[j])
    return np.stack([i[meet], j[meet]], axis=1)


def polygons_intersect(a: ArrayLike, b: ArrayLike) -> Evidence:
    """Evidence that two simple polygons (n, 2), convex or not, have a point in common; touching counts. Exact.

    (Slides "Polygon Intersection": contained vertex, intersecting edges. Neither alone finds every case: a cross of two
    bars has no contained vertex, and a polygon within another has no crossing edges.)
    """
    if len(contained_vertices(a, b)):
        return Evidence.VERTEX_OF_A
    if len(contained_vertices(b, a)):
        return Evidence.VERTEX_OF_B
    return Evidence.EDGES if len(crossing_edge_pairs(a, b)) else Evidence.SEPARATE


class SatResult(NamedTuple):
    """Result of the separating axis test.

    overlaps: touching counts. axis (2,): unit, from A to B; if they overlap, the axis of the minimum translation.
    distance (m): if they overlap, negative, and moving B by -distance * axis makes them touch; else the gap along
    the axis, which is at most their distance. edge: index of the axis' edge, B's edges counted after those of A; a
    hint for the next call. tested: number of axes tested, of which parallel edges of a polygon share one.
    """

    overlaps: bool
    axis: Array
    distance: float
    edge: int
    tested: int


def project(points: ArrayLike, axis: ArrayLike) -> tuple[Array, Array]:
    """Projections of points (n, width) onto axes (..., width): least and greatest dot product. (Slide "SAT", step 2)"""
    dots = np.asarray(coordinates(axis, "axis") @ point_set(points, "points").T)
    return dots.min(axis=-1), dots.max(axis=-1)


def sat_2d(a: ArrayLike, b: ArrayLike, hint: int = 0) -> SatResult:
    """Separating axis test of convex polygons (n, 2) of either orientation; ends at the first separating axis.

    (Slides "Separating Axis Theorem (SAT) - in 2D".) The axes are the edge normals, two for a square: parallel edges of
    a polygon share one, on which both sides are tested. A polygon's own projection ends at its edge, so the gap is that
    of the other polygon's nearest corner; whether there is a gap is decided by cross products, exactly. `hint`: the
    edge to try first, such as that of the last call. Raises ShapeError for concave
    polygons.
    """
    first, second = _counter_clockwise(a), _counter_clockwise(b)
    # relative to a corner, because far from the origin the dot products would cancel
    best, best_edge, axis = -np.inf, -1, np.zeros(2)
    count = len(first) + len(second)
    axes = [*_axes(first), *([k + len(first) for k in edges] for edges in _axes(second))]
    axes.sort(key=lambda edges: hint % count not in edges)  # that of the hint comes first, the others stay in order
    for tested, edges in enumerate(axes, start=1):
        for edge in sorted(edges, key=lambda k: k != hint % count):
            own, other, k = (first, second, edge) if edge < len(first) else (second, first, edge - len(first))
            start, end = own[k], own[(k + 1) % len(own)]
            along = end - start
            normal = np.array([along[1], -along[0]]) / np.hypot(*along)
            gap = float(((other - start) @ normal).min())
            separates = bool((np.asarray(orient2d(start, end, other)) < 0.0).all())
            if gap > best or separates:
                best, best_edge, axis = gap, edge, normal if own is first else -normal
            if separates:
                return SatResult(False, axis, max(gap, 5e-324), edge, tested)
    return SatResult(True, axis, min(best, 0.0), best_edge, len(axes))


def _axes(polygon: Array) -> list[list[int]]:
    """Return the edges of each axis of a polygon (n, 2), in the order of the first ones: parallel edges share one."""
    along = np.roll(polygon, -1, axis=0) - polygon
    turn = np.arctan2(along[:, 1], along[:, 0]) % np.pi
    order = np.argsort(turn, kind="stable")
    same = np.diff(turn[order], append=turn[order[0]] + np.pi) <= PARALLEL  # the next one in the circle is parallel
    axes: list[list[int]] = [[]]
    for k, joins in zip(order.tolist(), same.tolist(), strict=True):
        axes[-1].append(k)
        if not joins:
            axes.append([])
    axes[0] = axes.pop() + axes[0] if len(axes) > 1 else axes[0]  # those across the begin of the circle
    return sorted(sorted(edges) for edges in axes if edges)


def _counter_clockwise(points: ArrayLike) -> Array:
    polygon = point_set(points, "polygon", 2, least=3)
    if not is_convex(polygon):
        raise ShapeError("polygon: SAT is for convex polygons; split this one with triangulation.convex_parts")
    polygon = polygon[polygon_corners(polygon)]
    return polygon if is_counter_clockwise(polygon) else polygon[::-1]
