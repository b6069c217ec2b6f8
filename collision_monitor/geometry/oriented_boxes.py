"""Oriented bounding boxes of a set of points: along the principal axes, and with minimum volume.

(Slides "OBB – oriented bounding boxes", "Oriented bounding box")
"""

from __future__ import annotations

from math import frexp, inf
from typing import Final

import numpy as np
from numpy.typing import ArrayLike

from collision_monitor.errors import ShapeError
from collision_monitor.geometry.bounding_volumes import Obb, convex_hull
from collision_monitor.geometry.coordinates import Array, point_set
from collision_monitor.geometry.qhull import qhull
from collision_monitor.tolerances import EPSILON

EDGE_DIRECTIONS: Final = 32
"""Up to this many edge directions of the hull, the normals perpendicular to each two of them are tried too (496).
Larger: seconds for hulls of hundreds of corners, to gain a percent. Smaller: a tetrahedron's box is twice too large."""

OUTLINE: Final = 128
"""Number of edges from which it is faster to find the outline first than to turn the box to every edge."""

FACE_NORMALS: Final = 256
"""Largest number of hull faces, the largest first, that a box is aligned with.
Larger: seconds for round hulls of a thousand similar faces. Smaller: the best face may be missed."""

MOST_TURNS: Final = 100
"""Turns about the best box's own axes. The volume falls at each one and no box was seen to take ten; larger values
change nothing, smaller ones would end the search early."""

SMALLEST: Final = 1e-90
"""Sizes (m) below which the points are enlarged first, because volumes and squares of lengths would vanish."""

DISTINCT: Final = 1e-9
"""Directions closer than this count as equal."""


def obb_pca(points: ArrayLike) -> Obb:
    """Box along the eigenvectors of the points' (n, 3) covariance. O(n); loose if the points crowd or form a cube.

    (Gottschalk, Lin and Manocha, OBBTree, 1996)
    """
    points = point_set(points, "points", 3)
    offset = points - points.mean(axis=0)
    _, axes = np.linalg.eigh(offset.T @ offset)
    return _along(points, axes)


def obb_minimum_volume(points: ArrayLike) -> Obb:
    """Smallest box among those with a side flush with the hull of points (n, 3) in m.

    A side of the box is aligned with each face of the hull (the 256 largest), and with each plane along two hull edges
    if there are few. The box is then turned about that side's normal until another side lies along an edge, which is
    the best turn (rotating calipers). Finally, this is repeated about the best box's own axes until the volume stops
    decreasing. The true minimum has two faces flush with edges (O'Rourke, 1985); this search finds it in most cases but
    does not prove it. The result is never larger than the PCA box or the axis-aligned one. Points in one plane get the
    best turn about its normal.
    """
    points = point_set(points, "points", 3)
    size = float(np.abs(points).max())
    if 0.0 < size < SMALLEST:
        scale = 2.0 ** (-frexp(size)[1] // 2)  # twice, because the inverse of a denormal number is infinite
        box = obb_minimum_volume(points * scale * scale)
        half = np.nextafter(box.half_extents / scale / scale, np.inf)
        return Obb(box.center / scale / scale, box.rotation, half)
    try:
        hull = convex_hull(points)
    except ShapeError:
        return _flat(points)
    vertices = hull.vertices - hull.vertices.mean(axis=0)
    a, b, c = vertices[hull.faces.T]
    edges = _distinct(np.concatenate([b - a, c - b, a - c]))
    across = np.cross(b - a, c - a)
    largest = np.argsort(-np.linalg.norm(across, axis=1), kind="stable")
    normals = _distinct(across[largest])[:FACE_NORMALS]
    if len(edges) <= EDGE_DIRECTIONS:
        i, j = np.triu_indices(len(edges), 1)
        normals = _distinct(np.concatenate([normals, np.cross(edges[i], edges[j])]))
    candidates = [_turned(vertices, edges, normal) for normal in normals]
    candidates += [_measured(vertices, obb_pca(points).rotation), _measured(vertices, np.eye(3))]
    volume, axes = min(candidates, key=lambda candidate: candidate[0])
    for _ in range(MOST_TURNS):
        turned = min((_turned(vertices, edges, axis) for axis in axes.T), key=lambda candidate: candidate[0])
        if not turned[0] < volume * (1 - 1e-12):
            break
        volume, axes = turned
    return _along(points, axes)


def _flat(points: Array) -> Obb:
    """Box of points in one plane, turned about the plane's normal; for points on one line, along the line."""
    axes = obb_pca(points).rotation  # the eigenvalues ascend, so the first axis is the normal
    offset = points - points.mean(axis=0)
    hull = qhull(offset @ axes[:, 1:])
    if hull is None:
        return _along(points, axes)
    a, b = np.moveaxis(hull.points[hull.simplices], 1, 0)
    edges = _distinct((b - a) @ axes[:, 1:].T)
    across = np.cross(axes[:, 0], edges)
    best = int((np.ptp(edges @ offset.T, axis=1) * np.ptp(across @ offset.T, axis=1)).argmin())
    return _along(points, np.column_stack([axes[:, 0], edges[best], across[best]]))


def _turned(vertices: Array, edges: Array, normal: Array) -> tuple[float, Array]:
    """Volume and axes of the smallest box with one axis along `normal` and a side along a projected edge.

    If no edge leaves the normal, as in a needle along it, the volume is infinite.
    """
    height = float(np.ptp(vertices @ normal))
    if len(edges) > OUTLINE:
        vertices, edges = _outline(vertices, edges, normal)
    sides = edges - (edges @ normal)[:, None] * normal
    length = np.linalg.norm(sides, axis=1, keepdims=True)
    kept = length[:, 0] > DISTINCT * np.linalg.norm(edges, axis=1).max()
    if not kept.any():
        return inf, np.eye(3)
    sides = sides[kept] / length[kept]
    across = _cross(normal, sides)
    area = np.ptp(sides @ vertices.T, axis=1) * np.ptp(across @ vertices.T, axis=1)
    best = int(area.argmin())
    axes = np.column_stack([normal, sides[best], across[best]])
    return float(area[best]) * height, axes


def _outline(vertices: Array, edges: Array, normal: Array) -> tuple[Array, Array]:
    """Corners and edges on the outline as seen along `normal`; all of them if the outline is a line."""
    u = _cross(normal, np.eye(3)[np.abs(normal).argmin()])
    hull = qhull(vertices @ np.column_stack([u, _cross(normal, u)]))
    if hull is None:
        return vertices, edges
    around = vertices[hull.vertices]
    return around, np.roll(around, -1, axis=0) - around


_NEXT, _LAST = [1, 2, 0], [2, 0, 1]


def _cross(a: Array, b: Array) -> Array:
    """a x b of vectors (..., 3), as np.cross, which takes ten times as long for few vectors."""
    return np.asarray(a[..., _NEXT] * b[..., _LAST] - a[..., _LAST] * b[..., _NEXT])


def _measured(vertices: Array, axes: Array) -> tuple[float, Array]:
    return float(np.ptp(vertices @ axes, axis=0).prod()), axes


def _distinct(directions: Array) -> Array:
    """Unit directions (m, 3) without duplicates, regardless of sign and length; drops directions of zero length."""
    length = np.linalg.norm(directions, axis=1)
    directions = directions[length > DISTINCT * length.max()] / length[length > DISTINCT * length.max(), None]
    largest = np.take_along_axis(directions, np.abs(directions).argmax(axis=1)[:, None], axis=1)
    directions = directions * np.sign(largest)
    _, first = np.unique(np.round(directions / DISTINCT), axis=0, return_index=True)
    return np.asarray(directions[np.sort(first)])


def _along(points: Array, axes: Array) -> Obb:
    """Box of points along orthonormal axes (3, 3, in columns), made right-handed, with half extents rounded up."""
    axes = axes * np.array([1.0, 1.0, np.copysign(1.0, np.linalg.det(axes))])
    base = 0.5 * points.min(axis=0) + 0.5 * points.max(axis=0)
    dots = (points - base) @ axes
    center = base + axes @ (0.5 * (dots.min(axis=0) + dots.max(axis=0)))
    half = np.abs((points - center) @ axes).max(axis=0)
    return Obb(center, axes, half + 8 * EPSILON * half.max())
