"""Four bounding spheres of a set of points, from the fastest to the smallest.

(Slides "Bounding sphere": the centre is half-way between the maximally separated pair, or the centroid; then the sphere
is adjusted point by point.)
All take points (n, 2 or 3) in m. The radius is the distance of the farthest point from the centre, rounded up.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Final

import numpy as np
from numpy.typing import ArrayLike

from collision_monitor.geometry.bounding_volumes import BoundingSphere
from collision_monitor.geometry.coordinates import Array, point_set
from collision_monitor.geometry.qhull import qhull
from collision_monitor.tolerances import EPSILON

GROWTH_THRESHOLD: Final = 1e-12
"""Excess distance of a point, as a part of the radius, above which the minimal sphere grows.
Smaller: with five or more points on the sphere, round-off selects them in turns. Larger: the sphere is larger than the
smallest one by this part."""

MOST_GROWTH: Final = 20_000
"""Spheres that the search for the smallest one tries. Its expected number grows as the cube of the logarithm of the
number of points (300 for a million). Only points that are chosen to be in the worst order need more; the sphere around
them is then the grown one."""


def sphere_from_centroid(points: ArrayLike) -> BoundingSphere:
    """Sphere around the mean of the points. O(n); up to twice the smallest radius if the points crowd at one end."""
    points = point_set(points, "points")
    return _around(points, points[0] + (points - points[0]).mean(axis=0))


def sphere_from_widest_pair(points: ArrayLike) -> BoundingSphere:
    """Sphere around the midpoint of the two points farthest apart. O(h²) for h points on the hull."""
    from scipy.spatial.distance import cdist

    points = point_set(points, "points")
    outer = _outer(points)
    offset = outer - outer[0]
    # row by row, as the whole table of distances would not fit into memory for large sets
    widest, pair = -1.0, (0, 0)
    for first in range(0, len(outer), 256):
        apart = cdist(offset[first : first + 256], offset)
        i, j = np.unravel_index(apart.argmax(), apart.shape)
        if apart[i, j] > widest:
            widest, pair = float(apart[i, j]), (first + int(i), int(j))
    return _around(points, 0.5 * outer[pair[0]] + 0.5 * outer[pair[1]])


def sphere_grown(points: ArrayLike) -> BoundingSphere:
    """Sphere grown from a wide pair: each point outside moves and enlarges the sphere just enough to reach it.

    The pair is the point farthest from the first point, and the point farthest from that one.
    O(n); about 5 % larger than the smallest. Depends on the points' order. (Ritter, An efficient bounding sphere, 1990)
    """
    points = point_set(points, "points")
    p = points[np.linalg.norm(points - points[0], axis=1).argmax()]
    q = points[np.linalg.norm(points - p, axis=1).argmax()]
    center, radius = 0.5 * p + 0.5 * q, 0.5 * float(np.linalg.norm(q - p))
    k = 0
    while k < len(points):  # terminates: k grows in each turn
        distance = np.linalg.norm(points[k:] - center, axis=1)
        outside = np.flatnonzero(distance > radius)
        if not len(outside):
            break
        k += int(outside[0])
        away = float(distance[outside[0]])
        radius, shift = 0.5 * (radius + away), 0.5 * (away - radius)
        center = center + shift / away * (points[k] - center)
        k += 1
    return _around(points, center)


def minimal_sphere(points: ArrayLike) -> BoundingSphere:
    """Smallest sphere, to about 1e-12 of its radius. About ten passes over the points.

    (Welzl, Smallest enclosing disks, 1991; Gärtner, Fast and robust smallest enclosing balls, 1999: the farthest point
    first)
    """
    points = point_set(points, "points")
    outer = np.unique(_outer(points), axis=0)
    base = outer.mean(axis=0)
    size = float(np.abs(outer - base).max()) or 1.0
    # a random order makes the expected time linear; a fixed seed makes the result reproducible
    shuffled = np.random.default_rng(0).permutation((outer - base) / size)
    found = _smallest_of_few(shuffled, iter(range(MOST_GROWTH)))
    return sphere_grown(points) if found is None else _around(points, base + size * found[0])


def _smallest_of_few(points: Array, tries: Iterator[int]) -> tuple[Array, float] | None:
    """As `_smallest`, for no points on the surface: around a few points, to which the farthest one is added in turn."""
    few, none = points[:1], points[:0]
    while True:  # terminates: each turn takes one of the tries
        found = _smallest(few, none, tries)
        if found is None or next(tries, None) is None:
            return None
        center, radius = found
        distance = np.linalg.norm(points - center, axis=1)
        k = int(distance.argmax())
        if not distance[k] > radius * (1 + GROWTH_THRESHOLD):
            return found
        few = np.vstack([points[k], few])


def _smallest(points: Array, touching: Array, tries: Iterator[int]) -> tuple[Array, float] | None:
    """Centre and radius of the smallest sphere around `points` with all points of `touching` on its surface.

    None if it takes more than the tries.
    """
    center, radius = _through(touching) if len(touching) else (points[0], 0.0)
    if len(touching) == points.shape[1] + 1:
        return center, radius
    k = 0
    while k < len(points):  # terminates: k grows in each turn
        distance = np.linalg.norm(points[k:] - center, axis=1)
        outside = np.flatnonzero(distance > radius * (1 + GROWTH_THRESHOLD))
        if not len(outside):
            break
        k += int(outside[0])
        # a point outside the smallest sphere of the points before it is on the surface of the next sphere
        if next(tries, None) is None:
            return None
        found = _smallest(points[:k], np.vstack([touching, points[k]]), tries)
        if found is None:
            return None
        center, radius = found
        k += 1
    return center, radius


def _through(touching: Array) -> tuple[Array, float]:
    """Centre and radius of the smallest sphere through up to 3 points in the plane, 4 in space."""
    edges = touching[1:] - touching[0]
    weights = np.linalg.lstsq(2 * edges @ edges.T, (edges * edges).sum(axis=1), rcond=None)[0]
    offset = weights @ edges
    return touching[0] + offset, float(np.linalg.norm(offset))


def _outer(points: Array) -> Array:
    """Hull corners, which determine the widest pair and the smallest sphere; all points if they are flat or few."""
    if len(points) <= 64:
        return points
    hull = qhull(points)
    return points if hull is None else np.asarray(points[np.sort(hull.vertices)])


def _around(points: Array, center: Array) -> BoundingSphere:
    distance = float(np.linalg.norm(points - center, axis=1).max())
    return BoundingSphere(center, np.asarray(distance * (1 + 4 * EPSILON)))
