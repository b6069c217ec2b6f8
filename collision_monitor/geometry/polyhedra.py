"""Polyhedra as closed triangle meshes: point location, and edges against faces. All decisions are exact.

A mesh is vertices (n, 3) in m and faces (m, 3) of vertex indices, counter-clockwise from outside.
(Slides "Collision detection: polyhedra")
"""

from __future__ import annotations

from typing import Final, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from collision_monitor.errors import InputError, ShapeError
from collision_monitor.geometry.coordinates import Array, Booleans, Indices, Signs, coordinates, triangles
from collision_monitor.geometry.crossing_filter import UNDECIDED, tabulate_crossings
from collision_monitor.geometry.lines import segments_intersect
from collision_monitor.geometry.orientation import orient2d, orient3d
from collision_monitor.geometry.point_in_polygon import Location
from collision_monitor.tolerances import EPSILON

POINTS_AT_ONCE: Final = (256, 4096)
"""Least and most points located together in a mesh. Larger: more faces are near some of them. Smaller: more iterations.
"""

TESTS_AT_ONCE: Final = 1 << 15
"""Pairs of a point and a face tested together if that allows more than the least number of points. Larger: no faster.
Smaller: meshes of a few faces take several times as long."""

COPLANAR: Final = 32 * EPSILON
"""Height of a corner of a triangle above the plane of its neighbour, as part of the size, up to which both are one
face. Vertices have round-off of a few EPSILON."""


def mesh_edges(faces: ArrayLike) -> Indices:
    """Edges (k, 2) of a mesh's faces (m, 3) without duplicates, smaller vertex index first, sorted."""
    faces = np.asarray(faces, dtype=np.int64)
    return np.unique(np.sort(faces[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1), axis=0)


class FlatFaces(NamedTuple):
    """The faces of a polyhedron, each of one or more triangles in a plane, and the edges between two of them.

    face (m,): number of the face of each triangle. edges (k, 2): vertices, smaller index first, sorted.
    """

    face: Indices
    edges: Indices


def flat_faces(vertices: Array, faces: Indices) -> FlatFaces:
    """Join the triangles (m, 3) of a surface that lie in one plane, up to the round-off of their vertices (n, 3).

    A diagonal of a face is no edge of the polyhedron. An edge that does not belong to two triangles stays one.
    """
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    corners = vertices[faces] - vertices[faces[0, 0]]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    length = np.linalg.norm(normals, axis=1, keepdims=True)
    normals = normals / np.where(length > 0.0, length, 1.0)
    ends = np.sort(faces[:, [[1, 2], [2, 0], [0, 1]]].reshape(-1, 2), axis=1)  # the edge opposite to each corner
    order = np.lexsort(ends.T[::-1])
    edges, first, count = np.unique(ends[order], axis=0, return_index=True, return_counts=True)
    pair = first[count == 2]
    one, other = order[pair], order[pair + 1]  # the corners opposite to an edge of two triangles
    apex = corners.reshape(-1, 3)
    height_one = np.einsum("ki,ki->k", normals[other // 3], apex[one] - apex[_next(other)])
    height_other = np.einsum("ki,ki->k", normals[one // 3], apex[other] - apex[_next(one)])
    flat = np.maximum(np.abs(height_one), np.abs(height_other)) <= COPLANAR * np.abs(corners).max()
    is_edge = np.ones(len(edges), bool)
    is_edge[np.flatnonzero(count == 2)[flat]] = False
    joined = coo_array((np.ones(flat.sum()), (one[flat] // 3, other[flat] // 3)), (len(faces), len(faces)))
    return FlatFaces(connected_components(joined, directed=False)[1].astype(np.int64), edges[is_edge])


def _next(corner: Indices) -> Indices:
    """Return the corner behind another one of the same triangle."""
    return corner - corner % 3 + (corner + 1) % 3


def is_closed(faces: ArrayLike) -> bool:
    """Whether faces (m, 3) enclose a volume without a gap: each edge belongs to an even number of faces."""
    faces = np.asarray(faces, dtype=np.int64)
    ends = faces, np.roll(faces, -1, axis=1)
    keys = np.sort((np.minimum(*ends) * (int(faces.max(initial=0)) + 1) + np.maximum(*ends)).ravel())
    first = np.flatnonzero(np.diff(keys, prepend=-1))  # of each edge among its equals
    return bool((np.diff(first, append=len(keys)) % 2 == 0).all())


def closed_mesh(vertices: ArrayLike, faces: ArrayLike, what: str = "mesh") -> tuple[Array, Indices]:
    """Check a closed triangle mesh: vertices (n, 3), faces (m, 3) of vertex indices, m >= 1. Raises ShapeError."""
    vertices, faces = triangles(vertices, faces, what)
    if not is_closed(faces):
        raise ShapeError(f"{what}: expected a closed surface, got edges that belong to an odd number of faces")
    return vertices, faces


def locate_in_convex_polyhedron(points: ArrayLike, vertices: ArrayLike, faces: ArrayLike) -> Signs:
    """Location (...) of points (..., 3) in a convex polyhedron: on the inner side of the planes of all faces.

    (Slide "A vertex is inside a convex polyhedron if it's on the 'inside' side of all faces".) Flat faces are skipped.
    """
    p = coordinates(points, "points", 3)[..., None, :]
    vertices, faces = triangles(vertices, faces)
    a, b, c = (vertices[corner] for corner in faces.T)
    return np.asarray(np.sign(-orient3d(a, b, c, p)[..., ~flat_triangles(a, b, c)]).min(axis=-1)).astype(np.int8)


def locate_in_polyhedron(points: ArrayLike, vertices: ArrayLike, faces: ArrayLike) -> Signs:
    """Location (...) of points (..., 3) in any closed polyhedron, by the parity of a ray towards +z.

    (Slide "A vertex is inside a concave polyhedron if a semi-infinite ray from the vertex intersects an odd number of
    faces".) A ray through an edge or a vertex, or along a face, is no special case: the ray is shifted symbolically by
    (e, e²) in x and y for an infinitely small e. A point on a face is found beforehand, exactly.
    Raises ShapeError for a mesh that is not closed.
    """
    points = coordinates(points, "points", 3)
    vertices, faces = closed_mesh(vertices, faces)
    p = points.reshape(-1, 3)
    found = ray_crossings(p, vertices, faces)
    odd = np.bincount(found.point, minlength=len(p)) % 2 == 1
    location = np.where(found.on_face, Location.BOUNDARY, np.where(odd, Location.INSIDE, Location.OUTSIDE))
    return location.reshape(points.shape[:-1]).astype(np.int8)


class Crossings(NamedTuple):
    """Faces that rays towards +z meet: indices point (k,) and face (k,), and turn (k,), 1 if the face looks up.

    on_face (n,): whether each point lies on a face, exactly.
    """

    point: Indices
    face: Indices
    turn: Array
    on_face: Booleans


def ray_crossings(points: Array, vertices: Array, faces: Indices) -> Crossings:
    """Faces (m, 3) that the rays from the points (n, 3) towards +z meet, as in `locate_in_polyhedron`."""
    a, b, c = (vertices[corner] for corner in faces.T)
    x = vertices[faces, 0]
    low, high = x.min(axis=1), x.max(axis=1)
    on_face = np.zeros(len(points), bool)
    order = np.argsort(points[:, 0])
    nothing = np.zeros(0, np.int64)
    met: list[tuple[Indices, Indices, Array]] = [(nothing, nothing, np.zeros(0))]
    least, most = POINTS_AT_ONCE
    at_once = min(max(TESTS_AT_ONCE // len(faces), least), most)
    for first in range(0, len(points), at_once):  # points in order of x, so that few faces are near each batch
        some = order[first : first + at_once]
        near = np.flatnonzero((low <= points[some[-1], 0]) & (points[some[0], 0] <= high))
        table = np.empty((len(some), len(near)), np.int8)
        tabulate_crossings(points[some], a[near], b[near], c[near], table)
        i, j = np.nonzero(table)
        turn = table[i, j].astype(np.float64)
        i, j = some[i], near[j]
        k = np.flatnonzero(turn == UNDECIDED)
        if len(k):
            turn[k], touches = _exact_crossings(points[i[k]], *(corner[j[k]] for corner in (a, b, c)))
            on_face[i[k[touches]]] = True
        through = turn != 0.0
        met.append((i[through], j[through], turn[through]))
    point, face, turn = (np.concatenate(column) for column in zip(*met, strict=True))
    return Crossings(point, face, turn, on_face)


def _exact_crossings(p: Array, a: Array, b: Array, c: Array) -> tuple[Array, Booleans]:
    """Turn (k,) of each face a, b, c (k, 3) that the ray from p (k, 3) meets, else 0, and whether p is on the face."""
    height = np.asarray(orient3d(a, b, c, p))
    on_face = height == 0.0
    on_face[on_face] = _in_flat_triangle(*(point[on_face] for point in (p, a, b, c)))
    turn = _perturbed_turn(p, a, b, c)
    # the ray meets the face if its point is behind a face that looks up, or in front of one that looks down
    return np.where(turn * height < 0.0, turn, 0.0), on_face


class EdgeFace(NamedTuple):
    """meets (...): the edge and the face have a point in common; t (...) and the point (..., 3) of it, else NaN."""

    meets: Booleans
    t: Array
    point: Array


def edge_face(p: ArrayLike, q: ArrayLike, a: ArrayLike, b: ArrayLike, c: ArrayLike) -> EdgeFace:
    """Intersections of edges p, q with triangles a, b, c (..., 3 each), ends and boundary included; `meets` is exact.

    (Slide "Edge intersection face test": the edge's ends are on opposite sides of the face's plane, and the point where
    the edge meets the plane is inside the face.) For an edge in the face's plane, t is that of an end inside, or NaN.
    A triangle without area meets nothing, because in a closed mesh its neighbours cover it.
    """
    points = [coordinates(x, name, 3) for x, name in ((p, "p"), (q, "q"), (a, "a"), (b, "b"), (c, "c"))]
    try:
        p, q, a, b, c = np.broadcast_arrays(*points)
    except ValueError:
        raise InputError(f"expected shapes that broadcast, got {[point.shape for point in points]}") from None
    shape = p.shape[:-1]
    p, q, a, b, c = (point.reshape(-1, 3) for point in (p, q, a, b, c))
    before, after = np.asarray(orient3d(a, b, c, p)), np.asarray(orient3d(a, b, c, q))
    in_plane = (before == 0.0) & (after == 0.0)
    meets = (np.sign(before) * np.sign(after) <= 0.0) & ~in_plane
    # all three sides of the triangle must be on one hand of the line through p and q
    turns = np.zeros((3, len(p)))
    k = np.flatnonzero(meets)
    for side, (start, end) in enumerate(((a, b), (b, c), (c, a))):
        turns[side, k] = orient3d(p[k], q[k], start[k], end[k])
    meets &= (turns >= 0.0).all(axis=0) | (turns <= 0.0).all(axis=0)
    t = np.where(meets, before / np.where(meets, before - after, 1.0), np.nan)
    k = np.flatnonzero(in_plane)
    k = k[~flat_triangles(a[k], b[k], c[k])]
    if len(k):
        meets[k], t[k] = _coplanar(*(x[k] for x in (p, q, a, b, c)))
    point = np.where((t > 0.5)[:, None], q - (1 - t)[:, None] * (q - p), p + t[:, None] * (q - p))
    return EdgeFace(meets.reshape(shape), t.reshape(shape), point.reshape((*shape, 3)))


def flat_triangles(a: Array, b: Array, c: Array) -> Booleans:
    """Whether triangles (..., 3) have no area, exactly: no projection onto a coordinate plane has an area."""
    return np.asarray(np.all([orient2d(a[..., k], b[..., k], c[..., k]) == 0.0 for k in _PLANES], axis=0))


_PLANES = ([0, 1], [1, 2], [2, 0])


def _perturbed_turn(p: Array, a: Array, b: Array, c: Array) -> Array:
    """Orientation of the triangle seen from above (1 up, -1 down) if it contains p shifted by (e, e²), else 0."""
    start, end = np.stack([a, b, c]), np.stack([b, c, a])
    sign = np.sign(orient2d(start[..., :2], end[..., :2], p[:, :2]))
    along = np.sign(end - start)
    # d/de of the determinant, then d/de²
    sign = np.where(sign == 0.0, -along[..., 1], sign)
    sign = np.where(sign == 0.0, along[..., 0], sign)
    same = (sign[0] == sign[1]) & (sign[1] == sign[2])
    return np.where(same, sign[0], 0.0)


def _in_flat_triangle(p: Array, a: Array, b: Array, c: Array) -> Booleans:
    """Whether p (m, 3) in the plane of a, b, c (m, 3) is in the triangle: all projections of p are in those of it."""
    low, high = np.minimum(np.minimum(a, b), c), np.maximum(np.maximum(a, b), c)
    inside = ((low <= p) & (p <= high)).all(axis=1)
    start, end = np.stack([a, b, c]), np.stack([b, c, a])
    for k in _PLANES:
        turn = orient2d(start[..., k], end[..., k], p[:, k])
        inside &= (turn >= 0.0).all(axis=0) | (turn <= 0.0).all(axis=0)
    return np.asarray(inside)


def _coplanar(p: Array, q: Array, a: Array, b: Array, c: Array) -> tuple[Booleans, Array]:
    """Whether edges p, q (m, 3) in the plane of triangles with an area meet them, and t of an end inside or NaN."""
    p_inside, q_inside = _in_flat_triangle(p, a, b, c), _in_flat_triangle(q, a, b, c)
    t = np.where(p_inside, 0.0, np.where(q_inside, 1.0, np.nan))
    # two coplanar segments meet if their projections do, on a coordinate plane that is not perpendicular to the
    # triangle
    shadows = np.array([orient2d(a[:, k], b[:, k], c[:, k]) != 0.0 for k in _PLANES])
    planes = np.array(_PLANES)[shadows.argmax(axis=0)]
    p, q, a, b, c = (np.take_along_axis(x, planes, axis=1) for x in (p, q, a, b, c))
    crosses = np.any([segments_intersect(p, q, start, end) for start, end in ((a, b), (b, c), (c, a))], axis=0)
    return p_inside | q_inside | crosses, t
