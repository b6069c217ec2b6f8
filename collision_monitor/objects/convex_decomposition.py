"""Convex decomposition of a concave mesh: a few convex parts that contain it, with bounds of the error.

CoACD (Wei et al., Approximate convex decomposition, 2022) cuts the mesh along planes and takes the hull of each piece.
CoACD guarantees only its own measure of concavity. A monitor needs more, so this module enlarges the parts until they
cover the mesh's surface, and computes the largest distance of a point of the parts from the mesh.
"""

from __future__ import annotations

from collections.abc import Iterable
from importlib import import_module
from typing import Any, Final, NamedTuple

import numpy as np

from collision_monitor.errors import InputError, ShapeError, UnsupportedError
from collision_monitor.geometry.bounded_cache import bounded_cache
from collision_monitor.geometry.bounding_volumes import Hull, convex_hull
from collision_monitor.geometry.coordinates import Array, Indices
from collision_monitor.geometry.point_in_polygon import Location
from collision_monitor.geometry.point_triangle import closest_point_on_triangle
from collision_monitor.geometry.polyhedra import locate_in_polyhedron
from collision_monitor.shapes.registry import ConvexHull, Mesh
from collision_monitor.shapes.shape import array_bytes

CONCAVITY: Final = 0.05
"""CoACD's threshold, from 0.01 (many parts) to 1: concavity allowed in a part, relative to the mesh's size."""

SEED: Final = 0
"""Seed of CoACD's random search, fixed so that a mesh always has the same parts."""

COVERED: Final = 1e-6
"""Part of the size by which the parts are enlarged, times four until they cover the surface, because CoACD rounds its
corners to some 1e-5. Smaller: more tries."""

MOST_GROWTHS: Final = 11
"""Enlargements by a factor of four: COVERED * 4^11 = 4.2 of the size, after which any one part contains the mesh."""

THINNEST: Final = 1e-9
"""Least volume of a mesh, as a part of its hull's. Below it the mesh has no inside, and the errors are round-off."""

MOST_PIECES: Final = 50_000
"""Polygons outside of the parts, and triangles between two bounds of the surface error (20 MB). A mesh with more is
refused, or gets the upper bound that is known then."""

SETTLED: Final = 0.02
"""Relative accuracy of the surface error; smaller values cost time."""

COARSE: Final = 1e-3
"""Accuracy of a small surface error, as part of the size."""

NEAREST_CENTRES: Final = 16
"""Faces, by their centres, among which the nearest is sought. Fewer: the stated error is larger than necessary."""

INSTALL: Final = "pip install '.[decomposition]' in a clone"


class Decomposition(NamedTuple):
    """parts: convex, together they contain the mesh. surface_error (m): bound on their points' distance from it.

    volume_error: excess of the sum of the parts' volumes, as a fraction of the mesh's volume.

    >>> Decomposition((), surface_error=0.0, volume_error=0.0).surface_error
    0.0
    """

    parts: tuple[ConvexHull, ...]
    surface_error: float
    volume_error: float


REMEMBERED_DECOMPOSITIONS: Final = 32 << 20
"""Bytes of meshes and their parts that are remembered. Less: a mesh that is described again is decomposed again."""


def _memory(found: Decomposition, mesh: Mesh, concavity: float = CONCAVITY) -> int:
    return array_bytes(mesh) + sum(map(array_bytes, found.parts))


@bounded_cache(REMEMBERED_DECOMPOSITIONS, _memory)
def convex_decomposition(mesh: Mesh, concavity: float = CONCAVITY) -> Decomposition:
    """Decompose a closed mesh into convex parts; takes seconds. The result is cached for the mesh.

    Raises UnsupportedError if CoACD is not installed or leaves a hollow, ShapeError for a mesh that is not closed,
    InputError for a concavity out of range.

    >>> corners = [(x, y, z) for x in (0, 1) for y in (0, 1) for z in (0, 1)]
    >>> quads = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    >>> cube = Mesh(corners, [(q[0], q[k], q[k + 1]) for q in quads for k in (1, 2)])
    >>> len(convex_decomposition(cube).parts)  # with CoACD installed
    1
    """
    if not isinstance(mesh, Mesh):
        raise ShapeError(f"convex decomposition: expected a Mesh, got {mesh!r:.100}")
    if not isinstance(concavity, int | float) or not 0.01 <= concavity <= 1.0:
        raise InputError(f"concavity: expected a number from 0.01 to 1, got {concavity!r:.100}")
    try:
        coacd: Any = import_module("coacd")
    except ImportError:
        raise UnsupportedError(f"model convex_decomposition needs CoACD: {INSTALL}") from None
    welded = mesh.surface.faces.astype(np.int32)
    if not mesh.surface.closed:
        raise ShapeError(f"convex decomposition: expected a closed mesh, got {mesh!r}")
    coacd.set_log_level("error")
    # centred and scaled to size 1, so that the result does not depend on position and size
    used = mesh.vertices[np.unique(welded)]
    center = 0.5 * used.min(axis=0) + 0.5 * used.max(axis=0)
    size = float(np.ptp(used, axis=0).max())
    vertices = (mesh.vertices - center) / (size or 1.0)
    solid = abs(Hull(vertices, welded.astype(np.int64)).volume)
    if not solid > THINNEST * convex_hull((used - center) / (size or 1.0)).volume:  # raises ShapeError if it is flat
        raise ShapeError("convex decomposition: expected a mesh with an inside, got one without volume")
    hulls = _solid_parts(coacd.run_coacd(coacd.Mesh(vertices, welded), threshold=concavity, seed=SEED))
    faces = list(vertices[welded])
    grown = COVERED
    for _ in range(MOST_GROWTHS):
        if not _uncovered(faces, hulls, grown):
            break
        grown *= 4.0
    else:
        raise UnsupportedError("convex decomposition: CoACD found no solid part in this mesh; use convex_hull")
    hulls = [_grown(hull, 2.0 * grown) for hull in hulls]
    outer = [
        polygon
        for k, hull in enumerate(hulls)
        for polygon in _uncovered(list(hull.vertices[hull.faces]), hulls[:k] + hulls[k + 1 :], 0.0)
    ]
    middles = np.array([polygon.mean(axis=0) for polygon in outer])
    inside = locate_in_polyhedron(middles, vertices, welded) == Location.INSIDE
    if inside.any() and float(_to_surface(middles[inside], vertices[welded])[0].max()) > 4.0 * grown:
        raise UnsupportedError("convex decomposition: CoACD's parts leave a hollow in this mesh; use convex_hull")
    return Decomposition(
        parts=tuple(ConvexHull(center + size * hull.vertices) for hull in hulls),
        surface_error=size * _farthest(outer, vertices[welded]),
        volume_error=sum(hull.volume for hull in hulls) / solid - 1.0,
    )


def _solid_parts(found: Iterable[tuple[Array, Any]]) -> list[Hull]:
    """Return the hulls of the parts that CoACD found, points and faces of each."""
    hulls = []
    for points, _ in found:
        try:
            hulls.append(convex_hull(points))
        except ShapeError:
            continue  # a flat part contains nothing that its neighbours do not
    return hulls


def _planes(hull: Hull) -> tuple[Array, Array]:
    """Outward unit normals (n, 3) and offsets (n,) of a hull's faces."""
    a, b, c = hull.vertices[hull.faces.T]
    normal = np.cross(b - a, c - a)
    length = np.linalg.norm(normal, axis=1)
    normal = normal[length > 0.0] / length[length > 0.0, None]
    return normal, (hull.vertices @ normal.T).max(axis=0)


def _grown(hull: Hull, by: float) -> Hull:
    """The hull enlarged about its middle, so that every face moves outward by at least `by`."""
    middle = hull.vertices.mean(axis=0)
    normal, offset = _planes(hull)
    return Hull(middle + (1.0 + by / float((offset - normal @ middle).min())) * (hull.vertices - middle), hull.faces)


def _uncovered(polygons: list[Array], hulls: list[Hull], slack: float) -> list[Array]:
    """Parts of convex polygons (k, 3) that are in none of the hulls after moving their planes outward by `slack`."""
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
        if len(polygons) > MOST_PIECES:
            raise UnsupportedError("convex decomposition: CoACD's parts leave too many gaps; use convex_hull")
    return polygons


def _without(polygon: Array, normal: Array, offset: Array) -> list[Array]:
    """Parts of a convex polygon outside the planes normal . x <= offset, as convex polygons."""
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
    """Part of a convex polygon where the height, given at its corners, is positive or zero."""
    kept = []
    for k in range(len(polygon)):
        after = (k + 1) % len(polygon)
        if height[k] >= 0.0:
            kept.append(polygon[k])
        if (height[k] > 0.0 > height[after]) or (height[k] < 0.0 < height[after]):
            kept.append(polygon[k] + height[k] / (height[k] - height[after]) * (polygon[after] - polygon[k]))
    return np.array(kept).reshape(-1, 3)


def _to_surface(points: Array, corners: Array) -> tuple[Array, Indices]:
    """Upper bounds (n,) of the distances of points from triangles (m, 3, 3), and the index of the triangle of each."""
    from scipy.spatial import cKDTree

    _, near = cKDTree(corners.mean(axis=1)).query(points, min(NEAREST_CENTRES, len(corners)))
    near = near.reshape(len(points), -1)
    apart = closest_point_on_triangle(points[:, None], *np.moveaxis(corners[near], 2, 0))[1]
    best = apart.argmin(axis=1)[:, None]
    return np.take_along_axis(apart, best, 1)[:, 0], np.take_along_axis(near, best, 1)[:, 0]


def _farthest(polygons: list[Array], corners: Array) -> float:
    """Largest distance of a point of some polygons from triangles (m, 3, 3), rounded up. Branch and bound.

    A distance changes by at most the displacement of its point, so within a triangle it exceeds that of the middle by
    at most the distance to the farthest corner. The distance from one face is largest at a corner of the triangle.
    """
    triangles = np.array([[p[0], p[k], p[k + 1]] for p in polygons for k in range(1, len(p) - 1)])
    known, upper = 0.0, COARSE
    while len(triangles):  # terminates: each turn halves the triangles, down to COARSE
        middle = triangles.mean(axis=1)
        distance, face = _to_surface(middle, corners)
        around = np.linalg.norm(triangles - middle[:, None], axis=2).max(axis=1)
        from_face = closest_point_on_triangle(triangles, *np.moveaxis(corners[face, None], 2, 0))[1].max(axis=1)
        reach = np.minimum(distance + around, from_face)
        known = max(known, float(distance.max()))
        upper = known + max(SETTLED * known, COARSE)
        if np.count_nonzero(reach > upper) > MOST_PIECES:
            return float(reach.max())
        triangles = triangles[reach > upper]
        a, b, c = np.moveaxis(triangles, 1, 0)
        ab, bc, ca = (a + b) / 2, (b + c) / 2, (c + a) / 2
        triangles = np.concatenate([np.stack(t, axis=1) for t in ((a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca))])
    return upper
