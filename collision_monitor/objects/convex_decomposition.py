"""A concave mesh as a few convex parts, which together contain it, with what they add stated.

The parts are CoACD's (Wei et al., Approximate convex decomposition, 2022), which cuts along planes and takes the hull
of each piece. What it promises is a measure of its own, so what a monitor needs is worked out here: the parts are grown
until no point of the mesh is outside of them, and the largest distance of a point of them from the mesh is sought.
"""

from __future__ import annotations

from functools import lru_cache
from importlib import import_module
from typing import Any, Final, NamedTuple

import numpy as np

from collision_monitor.errors import InputError, ShapeError, UnsupportedError
from collision_monitor.geometry.bounding_volumes import Hull, convex_hull
from collision_monitor.geometry.coordinates import Array, Indices
from collision_monitor.geometry.point_in_polygon import Location
from collision_monitor.geometry.point_triangle import closest_point_on_triangle
from collision_monitor.geometry.polyhedra import is_closed, locate_in_polyhedron
from collision_monitor.geometry.shapes import ConvexHull, Mesh

CONCAVITY: Final = 0.05
"""CoACD's threshold, from 0.01 (many parts) to 1: how concave a part may be, as part of the size of the mesh."""

SEED: Final = 0
"""CoACD searches by chance; with one seed a mesh always has the same parts."""

COVERED: Final = 1e-6
"""Part of the size that the parts are grown by, or four times as much until the surface is in them: CoACD rounds its
corners to some 1e-5. Smaller: more tries."""

SETTLED: Final = 0.02
"""The surface error is sought to this part of itself; smaller ones cost time."""

COARSE: Final = 1e-3
"""Or, where it is small, to this part of the size."""

NEAREST_CENTRES: Final = 16
"""Faces, by their centres, that are asked for the nearest one. Fewer: the stated error is larger than it has to be."""

INSTALL: Final = 'pip install "collision_monitor[decomposition]"'


class Decomposition(NamedTuple):
    """parts: convex, together they contain the mesh. surface_error (m): no point of them is farther than this from it.

    volume_error: by which part of the mesh's volume the parts' volumes add up to more.
    """

    parts: tuple[ConvexHull, ...]
    surface_error: float
    volume_error: float


@lru_cache(maxsize=64)
def convex_decomposition(mesh: Mesh, concavity: float = CONCAVITY) -> Decomposition:
    """Convex parts of a closed mesh; takes seconds, and is remembered for the mesh.

    Raises UnsupportedError where CoACD is not installed, ShapeError for a mesh that is not closed, InputError.
    """
    if not 0.01 <= concavity <= 1.0:
        raise InputError(f"concavity: expected a number from 0.01 to 1, got {concavity}")
    try:
        coacd: Any = import_module("coacd")
    except ImportError:
        raise UnsupportedError(f"model convex_decomposition needs CoACD: {INSTALL}") from None
    if not is_closed(mesh.faces):
        raise ShapeError(
            "convex decomposition: expected a closed mesh, got edges that belong to an odd number of faces"
        )
    coacd.set_log_level("error")
    # about its centre and one in size, so that where it is and how large changes nothing
    used = mesh.vertices[np.unique(mesh.faces)]
    center = 0.5 * used.min(axis=0) + 0.5 * used.max(axis=0)
    size = float(np.ptp(used, axis=0).max())
    vertices = (mesh.vertices - center) / size
    hulls = []
    for points, _ in coacd.run_coacd(coacd.Mesh(vertices, mesh.faces), threshold=concavity, seed=SEED):
        try:
            hulls.append(convex_hull(points))
        except ShapeError:
            continue  # a flat part holds nothing that its neighbours do not
    faces = list(vertices[mesh.faces])
    grown = COVERED
    while _uncovered(faces, hulls, grown):
        grown *= 4.0
    hulls = [_grown(hull, 2.0 * grown) for hull in hulls]
    outer = [
        polygon
        for k, hull in enumerate(hulls)
        for polygon in _uncovered(list(hull.vertices[hull.faces]), hulls[:k] + hulls[k + 1 :], 0.0)
    ]
    middles = np.array([polygon.mean(axis=0) for polygon in outer])
    inside = locate_in_polyhedron(middles, vertices, mesh.faces) == Location.INSIDE
    if inside.any() and float(_to_surface(middles[inside], vertices[mesh.faces])[0].max()) > 4.0 * grown:
        raise UnsupportedError("convex decomposition: CoACD's parts leave a hollow in this mesh; use convex_hull")
    solid = Hull(vertices, mesh.faces.astype(np.int64)).volume
    return Decomposition(
        parts=tuple(ConvexHull(center + size * hull.vertices) for hull in hulls),
        surface_error=size * _farthest(outer, vertices[mesh.faces]),
        volume_error=sum(hull.volume for hull in hulls) / abs(solid) - 1.0,
    )


def _planes(hull: Hull) -> tuple[Array, Array]:
    """Outward unit normals (n, 3) and offsets (n,) of a hull's faces."""
    a, b, c = hull.vertices[hull.faces.T]
    normal = np.cross(b - a, c - a)
    length = np.linalg.norm(normal, axis=1)
    normal = normal[length > 0.0] / length[length > 0.0, None]
    return normal, (hull.vertices @ normal.T).max(axis=0)


def _grown(hull: Hull, by: float) -> Hull:
    """The hull with every face moved outward by at least `by` (m): enlarged about its middle."""
    middle = hull.vertices.mean(axis=0)
    normal, offset = _planes(hull)
    return Hull(middle + (1.0 + by / float((offset - normal @ middle).min())) * (hull.vertices - middle), hull.faces)


def _uncovered(polygons: list[Array], hulls: list[Hull], slack: float) -> list[Array]:
    """What of convex polygons (k, 3) is in none of the hulls, each with its planes moved outward by `slack` (m)."""
    for hull in hulls:
        normal, offset = _planes(hull)
        low, high = hull.vertices.min(axis=0) - slack, hull.vertices.max(axis=0) + slack
        rest = []
        for polygon in polygons:
            if (polygon.max(axis=0) < low).any() or (high < polygon.min(axis=0)).any():
                rest.append(polygon)
            else:
                rest += _without(polygon, normal, offset + slack)
        polygons = rest
    return polygons


def _without(polygon: Array, normal: Array, offset: Array) -> list[Array]:
    """What of a convex polygon is outside of the planes normal . x <= offset, as convex polygons."""
    height = polygon @ normal.T - offset
    if (height.min(axis=0) >= 0.0).any():
        return [polygon]
    outside, inside = [], polygon
    for plane in np.flatnonzero(height.max(axis=0) > 0.0):
        above = inside @ normal[plane] - offset[plane]
        if above.max() > 0.0:
            outside.append(_half(inside, above))
            inside = _half(inside, -above)
            if len(inside) < 3:
                return [polygon]
    return [part for part in outside if len(part) >= 3]


def _half(polygon: Array, height: Array) -> Array:
    """The part of a convex polygon where the height of its corners is positive, and where it is zero."""
    kept = []
    for k in range(len(polygon)):
        after = (k + 1) % len(polygon)
        if height[k] >= 0.0:
            kept.append(polygon[k])
        if (height[k] > 0.0 > height[after]) or (height[k] < 0.0 < height[after]):
            kept.append(polygon[k] + height[k] / (height[k] - height[after]) * (polygon[after] - polygon[k]))
    return np.array(kept).reshape(-1, 3)


def _to_surface(points: Array, corners: Array) -> tuple[Array, Indices]:
    """Distances (n,) of points from the nearest of some triangles (m, 3, 3), or a little more, and which it is."""
    from scipy.spatial import cKDTree

    _, near = cKDTree(corners.mean(axis=1)).query(points, min(NEAREST_CENTRES, len(corners)))
    near = near.reshape(len(points), -1)
    apart = closest_point_on_triangle(points[:, None], *np.moveaxis(corners[near], 2, 0))[1]
    best = apart.argmin(axis=1)[:, None]
    return np.take_along_axis(apart, best, 1)[:, 0], np.take_along_axis(near, best, 1)[:, 0]


def _farthest(polygons: list[Array], corners: Array) -> float:
    """The largest distance of a point of some polygons from triangles (m, 3, 3), rounded up. Branch and bound.

    A distance changes by no more than one moves: from a triangle's middle, by no more than to its farthest corner. And
    from one face, a triangle is farthest at a corner.
    """
    triangles = np.array([[p[0], p[k], p[k + 1]] for p in polygons for k in range(1, len(p) - 1)])
    known, upper = 0.0, COARSE
    while len(triangles):
        middle = triangles.mean(axis=1)
        distance, face = _to_surface(middle, corners)
        around = np.linalg.norm(triangles - middle[:, None], axis=2).max(axis=1)
        from_face = closest_point_on_triangle(triangles, *np.moveaxis(corners[face, None], 2, 0))[1].max(axis=1)
        reach = np.minimum(distance + around, from_face)
        known = max(known, float(distance.max()))
        upper = known + max(SETTLED * known, COARSE)
        triangles = triangles[reach > upper]
        a, b, c = np.moveaxis(triangles, 1, 0)
        ab, bc, ca = (a + b) / 2, (b + c) / 2, (c + a) / 2
        triangles = np.concatenate([np.stack(t, axis=1) for t in ((a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca))])
    return upper
