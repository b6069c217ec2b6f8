"""Convex hull by gift wrapping, in the plane, in space, and of flat sets in space, all decisions exact.

A line or a plane is wrapped around the points: it turns about a corner or an edge of the hull until it meets the next
point. That takes time in proportion to points times corners; `bounding_volumes.convex_hull` uses Qhull, which is faster
and refuses flat sets. Source: slides "Convex Hull"; Chand and Kapur, An Algorithm for Convex Polytopes (1970); in the
plane Jarvis (1973).
"""

from __future__ import annotations

from typing import Final, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from collision_monitor.errors import ShapeError
from collision_monitor.geometry.coordinates import Array, Booleans, Indices, point_set
from collision_monitor.geometry.orientation import orient2d, orient3d

MOST_POINTS: Final = 10_000
"""Points of a set. If all of them are corners, each of the 20,000 triangles takes 1 ms."""


class WrappedHull(NamedTuple):
    """A convex hull by the numbers of its points.

    dimension: of what the points span: 0 a point, 1 a segment, 2 a polygon, 3 a solid. corners (k,): of a polygon
    counter-clockwise, else ascending; no corner lies between others. faces: of a solid polygons, counter-clockwise from
    outside; of a flat set in space its polygon; else none.
    """

    dimension: int
    corners: Indices
    faces: tuple[Indices, ...]


def gift_wrapping(points: ArrayLike) -> WrappedHull:
    """Convex hull of points (n, 2 or 3) in m, which may lie in one plane, on one line or in one place.

    Raises ShapeError for no points or more than MOST_POINTS.
    """
    given = point_set(points, "points", 2, 3)
    if len(given) > MOST_POINTS:
        raise ShapeError(f"gift wrapping: expected at most {MOST_POINTS} points, got {len(given)}")
    different, first = np.unique(given, axis=0, return_index=True)  # of equal points the first one counts
    hull = _hull(different)
    corners, faces = first[hull.corners], tuple(first[face] for face in hull.faces)
    return WrappedHull(hull.dimension, corners if hull.dimension == 2 else np.sort(corners), faces)


def _hull(points: Array) -> WrappedHull:
    """Return the hull of different points in lexicographic order."""
    n = len(points)
    if n == 1:
        return WrappedHull(0, np.array([0]), ())
    aside = np.flatnonzero(~_on_line(points[0], points[-1], points))
    if not len(aside):
        return WrappedHull(1, np.array([0, n - 1]), ())
    if points.shape[1] == 2:
        return WrappedHull(2, _ring(points), ())
    if (np.asarray(orient3d(points[0], points[-1], points[aside[0]], points)) == 0.0).all():
        ring = _face(points, np.arange(n), points[0], points[-1], points[aside[0]])
        return WrappedHull(2, ring, (ring,))
    faces = _wrap(points)
    return WrappedHull(3, np.unique(np.concatenate(faces)), tuple(faces))


def _wrap(points: Array) -> list[Indices]:
    """Return the faces of a solid hull: wrap around each edge that has one face until all have two."""
    faces: list[Indices] = []
    matched: set[tuple[int, int]] = set()
    unmatched = [_first_edge(points)]
    while unmatched:  # ends: each turn adds a face, of which there are fewer than 2 n
        edge = unmatched.pop()
        if edge in matched:
            continue
        face = _face_at(points, *edge)
        faces.append(face)
        for edge in zip(face.tolist(), np.roll(face, -1).tolist(), strict=True):
            matched.add(edge)
            if edge[::-1] not in matched:
                unmatched.append(edge[::-1])
    return faces


def _first_edge(points: Array) -> tuple[int, int]:
    """Return an edge of the hull of a solid: the lowest one in a vertical plane that has all points on one side.

    The points seen from above have an outline, and the plane stands on an edge of it.
    """
    flat, of_flat = np.unique(points[:, :2], axis=0, return_inverse=True)
    ring = _ring(flat)
    a, b = flat[ring[0]], flat[ring[1]]
    here = np.flatnonzero(_on_line(a, b, flat)[of_flat.reshape(-1)])
    along = int(np.abs(b - a).argmax())
    plane = np.stack([np.sign(b[along] - a[along]) * points[here, along], points[here, 2]], axis=1)
    start = int(np.lexsort((plane[:, 1], plane[:, 0]))[0])  # the lowest one above the corner a
    end = int(plane[:, 0].argmax())
    while True:  # ends: each turn goes down
        turn = np.asarray(orient2d(plane[start], plane[end], plane))
        below = np.flatnonzero(turn < 0.0)
        if not len(below):
            break
        end = int(below[turn[below].argmin()])
    level = np.flatnonzero(turn == 0.0)
    return int(here[start]), int(here[level[plane[level, 0].argmax()]])


def _face_at(points: Array, a: int, b: int) -> Indices:
    """Return the face that has the edge from a to b: turn a plane about it until all points are below."""
    p, q = points[a], points[b]
    c = int(np.flatnonzero(~_on_line(p, q, points))[0])
    while True:  # ends: each turn goes outwards
        height = np.asarray(orient3d(p, q, points[c], points))
        above = np.flatnonzero(height > 0.0)
        if not len(above):
            return _face(points, np.flatnonzero(height == 0.0), p, q, points[c])
        c = int(above[height[above].argmax()])


def _face(points: Array, on_plane: Indices, p: Array, q: Array, r: Array) -> Indices:
    """Return the polygon of the points in a plane, counter-clockwise as p, q, r."""
    for axis in np.argsort(-np.abs(np.cross(q - p, r - p))).tolist():  # seen along an axis that is not in the plane
        turn = float(orient2d(*(np.delete(each, axis) for each in (p, q, r))))
        if turn != 0.0:
            break
    ring = _ring(np.delete(points[on_plane], axis, axis=1))
    return on_plane[ring if turn > 0.0 else ring[::-1]]


def _ring(points: Array) -> Indices:
    """Return the corners of the hull of points (n, 2) that are not on one line, counter-clockwise."""
    start = int(np.lexsort(points.T[::-1])[0])
    ring = [start]
    while len(ring) <= len(points):
        at = points[ring[-1]]
        k = next(i for i in (0, 1) if (points[i] != at).any())
        while True:  # ends: each turn goes to the right
            turn = np.asarray(orient2d(at, points[k], points))
            right = np.flatnonzero(turn < 0.0)
            if not len(right):
                break
            k = int(right[turn[right].argmin()])
        level = np.flatnonzero(turn == 0.0)
        k = int(level[np.abs(points[level] - at).sum(axis=1).argmax()])  # the farthest on the line
        if k == start:
            return np.array(ring)
        ring.append(k)
    raise ShapeError("gift wrapping: expected a ring of corners, got none")  # exact turns always close


def _on_line(a: Array, b: Array, points: Array) -> Booleans:
    """Return whether points (n, 2 or 3) are on the line through a and b, exactly."""
    pairs = [[0, 1]] if points.shape[1] == 2 else [[0, 1], [1, 2], [2, 0]]
    turns = [np.asarray(orient2d(a[pair], b[pair], points[:, pair])) == 0.0 for pair in pairs]
    return np.asarray(np.logical_and.reduce(turns))
