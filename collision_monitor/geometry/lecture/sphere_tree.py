"""Sphere trees: a solid or a surface enclosed by ever smaller spheres, with inner balls inside it.

The distance of two trees is therefore known as an interval after every level, and a test may stop at any level.
(Hubbard, Approximating polyhedra with spheres for time-critical collision detection, 1996: the octree method, with
a sphere around each cell that meets the solid. Here, a cell also has a ball inside the solid.)
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import product
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from collision_monitor.errors import InputError
from collision_monitor.geometry.bounding_spheres import minimal_sphere
from collision_monitor.geometry.bounding_volumes import KDOP_DIRECTIONS
from collision_monitor.geometry.coordinates import Array, Booleans, Indices, triangles
from collision_monitor.geometry.point_in_polygon import Location
from collision_monitor.geometry.point_triangle import closest_point_on_triangle
from collision_monitor.geometry.polyhedra import is_closed, locate_in_polyhedron
from collision_monitor.geometry.runs import in_runs
from collision_monitor.shapes.pose import Pose
from collision_monitor.tolerances import EPSILON, ROUNDED_UP

DEEPEST: Final = 8
"""Largest number of levels below the root of a tree; a surface then meets some 400,000 cells."""

MOST_PAIRS: Final = 1_000_000
"""Pairs of spheres at which a query ends to limit its memory; its current interval is still valid."""

FACES_AT_ONCE: Final = 1 << 16
"""Pairs of a cell and a face tested in one batch, so that the table stays small."""

_AXES: Final = np.array([sign * np.array(d) / np.linalg.norm(d) for d in KDOP_DIRECTIONS[26] for sign in (1.0, -1.0)])
_OCTANTS: Final = np.array(list(product((-0.25, 0.25), repeat=3)))


class SphereLevel(NamedTuple):
    """Spheres that together enclose the shape, and balls inside it: centers (n, 3) and radii (n,) in m.

    A ball of radius 0 is a point of the shape. parent (n,): index of the sphere's parent in the level before.
    """

    center: Array
    radius: Array
    inner_center: Array
    inner_radius: Array
    parent: Indices


SphereTree = tuple[SphereLevel, ...]
"""Levels from a single sphere to the finest level."""


class DistanceInterval(NamedTuple):
    """Interval of the signed distance: at least lower and at most upper (m)."""

    lower: float
    upper: float


def sphere_tree(vertices: ArrayLike, faces: ArrayLike, depth: int = 5) -> SphereTree:
    """Build the tree of a mesh (vertices (n, 3) in m, faces (m, 3)): of the solid if it is closed, else of the surface.

    The cells of level k have 2^-k of the size. Its spheres have a radius of 0.87 cells and exceed the shape by less
    than twice that. Raises ShapeError, InputError.
    """
    vertices, faces = triangles(vertices, faces)
    if not 0 <= depth <= DEEPEST:
        raise InputError(f"sphere tree: expected a depth from 0 to {DEEPEST}, got {depth}")
    corners = vertices[faces]
    low, high = corners.min(axis=(0, 1)), corners.max(axis=(0, 1))
    width = size = float((high - low).max())
    closed = is_closed(faces)
    center, parent = np.array([0.5 * low + 0.5 * high]), np.zeros(1, np.int64)
    owner, face = np.zeros(len(faces), np.int64), np.arange(len(faces))  # faces that may be nearest to each cell
    levels: list[SphereLevel] = []
    carried: SphereLevel | None = None  # cells that are entirely inside, which are not split
    while len(center) and len(levels) <= depth:  # at most DEEPEST + 1 turns
        nearest, distance, apart = _nearest(center, corners, owner, face)
        inside = np.zeros(len(center), bool)
        if closed:
            inside = locate_in_polyhedron(center, vertices, faces) >= Location.BOUNDARY
        reach = np.sqrt(0.75) * width * (1.0 + ROUNDED_UP)
        level = SphereLevel(
            center=center,
            radius=np.full(len(center), reach),
            inner_center=np.where(inside[:, None], center, nearest),
            inner_radius=np.where(inside, np.maximum(distance - ROUNDED_UP * size, 0.0), 0.0),
            parent=parent,
        )
        kept = inside | (distance <= reach)
        split = kept & ~(inside & (distance > reach))
        level = _chosen(level, kept)
        whole = ~split[kept]
        if carried is not None:
            level = _joined(level, carried)
            whole = np.concatenate([whole, np.ones(len(carried.parent), bool)])
        levels.append(level)
        carried = _chosen(level, whole)._replace(parent=np.flatnonzero(whole))
        # a child's center is half a reach from its parent's, so farther faces cannot be nearest to it
        near = split[owner] & (apart <= distance[owner] + reach)
        place = np.cumsum(split) - 1
        owner, face = (8 * place[owner[near]] + np.arange(8)[:, None]).ravel(), np.tile(face[near], 8)
        order = np.argsort(owner, kind="stable")
        owner, face = owner[order], face[order]
        center, parent = (center[split, None] + width * _OCTANTS).reshape(-1, 3), np.repeat(np.flatnonzero(~whole), 8)
        width /= 2.0
    ball = minimal_sphere(vertices[np.unique(faces)])
    levels[0] = levels[0]._replace(center=ball.center[None], radius=ball.radius[None] * (1.0 + ROUNDED_UP))
    return _with_best_balls(_sorted(levels))


def _chosen(level: SphereLevel, which: Booleans | Indices) -> SphereLevel:
    return SphereLevel._make(field[which] for field in level)


def _joined(level: SphereLevel, other: SphereLevel) -> SphereLevel:
    return SphereLevel._make(np.concatenate(pair) for pair in zip(level, other, strict=True))


def _nearest(points: Array, corners: Array, owner: Indices, face: Indices) -> tuple[Array, Array, Array]:
    """Nearest points (n, 3) of triangles to points, their distances (n,), and the distances of all pairs (m,).

    A pair is point owner (m,) and triangle face (m,), sorted by the point. Each point has at least one pair.
    """
    parts = [
        closest_point_on_triangle(points[owner[some]], *np.moveaxis(corners[face[some]], 1, 0))
        for some in (slice(k, k + FACES_AT_ONCE) for k in range(0, len(owner), FACES_AT_ONCE))
    ]
    closest, apart = (np.concatenate(part) for part in zip(*parts, strict=True))
    every = np.arange(len(points))
    distance = np.minimum.reduceat(apart, np.searchsorted(owner, every))
    hits = np.flatnonzero(apart == distance[owner])
    return closest[hits[np.searchsorted(owner[hits], every)]], distance, apart


def _sorted(levels: list[SphereLevel]) -> list[SphereLevel]:
    """Reorder the levels so that the spheres of one parent are contiguous."""
    place = np.zeros(1, np.int64)
    result = []
    for level in levels:
        parent = place[level.parent]
        order = np.argsort(parent, kind="stable")
        result.append(_chosen(level._replace(parent=parent), order))
        place = np.argsort(order, kind="stable")
    return result


def _with_best_balls(levels: list[SphereLevel]) -> SphereTree:
    """Give each sphere the largest ball among its own and those of its descendants."""
    for upper, lower in zip(levels[-2::-1], levels[:0:-1], strict=True):
        order = np.lexsort((-lower.inner_radius, lower.parent))
        parents, first = np.unique(lower.parent[order], return_index=True)
        best = order[first]
        larger = lower.inner_radius[best] > upper.inner_radius[parents]
        upper.inner_radius[parents[larger]] = lower.inner_radius[best[larger]]
        upper.inner_center[parents[larger]] = lower.inner_center[best[larger]]
    return tuple(levels)


def distance_intervals(a: SphereTree, pose_a: Pose, b: SphereTree, pose_b: Pose) -> Iterator[DistanceInterval]:
    """Intervals of the signed distance after each level, ever narrower; stop when one is narrow enough.

    If the trees are apart, the lower end is the least distance of two spheres and the upper end that of two inner
    balls. If the spheres overlap, the lower end is the gap along the best of a few directions, as in SAT, and the
    interval does not converge. Only pairs of spheres that could contain the nearest points are followed.
    """
    p_AB = pose_b.position - pose_a.position
    i = j = np.zeros(1, np.int64)
    lower, upper = -np.inf, np.inf
    for k, (level_a, level_b) in enumerate(zip(a, b, strict=False)):
        if k > 0:
            i, j = _children(i, j, level_a.parent, level_b.parent)
        A, B = level_a.center @ pose_a.rotation.T, level_b.center @ pose_b.rotation.T + p_AB
        inner_A, inner_B = level_a.inner_center @ pose_a.rotation.T, level_b.inner_center @ pose_b.rotation.T + p_AB
        slack = 16 * EPSILON * float(np.abs(p_AB).max() + level_a.radius[0] + level_b.radius[0])
        between = inner_B[j] - inner_A[i]
        apart = np.linalg.norm(between, axis=1)
        inner = apart - level_a.inner_radius[i] - level_b.inner_radius[j]
        best = int(inner.argmin())
        upper = min(upper, float(inner[best]) + slack)
        outer = np.linalg.norm(B[j] - A[i], axis=1) - level_a.radius[i] - level_b.radius[j]
        if outer.min() > slack:
            lower = max(lower, float(outer.min()) - slack)
        axes = _AXES if apart[best] == 0.0 else np.vstack([_AXES, between[best] / apart[best]])
        gaps = (B @ axes.T - level_b.radius[:, None]).min(axis=0) - (A @ axes.T + level_a.radius[:, None]).max(axis=0)
        lower = max(lower, float(gaps.max()) - slack)
        yield DistanceInterval(lower, upper)
        near = outer <= upper + slack
        i, j = i[near], j[near]
        # no pair is left if two balls overlap more deeply than any two finer spheres
        if not len(i) or 64 * len(i) > MOST_PAIRS:
            return


def _children(i: Indices, j: Indices, parent_a: Indices, parent_b: Indices) -> tuple[Indices, Indices]:
    """All pairs of a child of i and a child of j."""
    first_a, count_a = _ranges(i, parent_a)
    first_b, count_b = _ranges(j, parent_b)
    total = count_a * count_b
    pair, rank = in_runs(total)
    return first_a[pair] + rank // count_b[pair], first_b[pair] + rank % count_b[pair]


def _ranges(i: Indices, parent: Indices) -> tuple[Indices, Indices]:
    first = np.searchsorted(parent, i)
    return first, np.searchsorted(parent, i, side="right") - first
