"""Separating axis test of two convex polyhedra, which tries the axis of the last call first.

The monitor tests boxes with narrow_phase/box_box.py, the same test compiled, and hulls with GJK and EPA, which do not
examine every pair of edges.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from collision_monitor.geometry.bounding_volumes import Hull
from collision_monitor.geometry.coordinates import Array, Indices
from collision_monitor.geometry.polyhedra import flat_faces
from collision_monitor.tolerances import FACE_PREFERENCE, PARALLEL_SIN2


class PolyhedronSat(NamedTuple):
    """Result of the separating axis test.

    overlaps: touching counts. axis (3,): unit, from A to B; if they overlap, the axis of the minimum translation.
    distance (m): if they overlap, negative, and moving B by -distance * axis makes them touch; else the gap along the
    axis, which is at most their distance. number: index of the axis, a hint for the next call: faces of A, faces of B,
    then edges of A times edges of B. tested: number of axes tested.
    """

    overlaps: bool
    axis: Array
    distance: float
    number: int
    tested: int


def sat_3d(a: Hull, b: Hull, hint: int = 0) -> PolyhedronSat:
    """Separating axis test of two convex hulls in one frame; ends at the first stage with a separating axis.

    (Slides "Separating Axis Theorem (SAT)"; Gottschalk, Lin, Manocha, OBBTree, 1996) The axes are the outward normals
    of the faces and the cross products of the edges: of a box and a pyramid 6 + 5 and 12 * 8. The diagonals between
    triangles of one face are no edges. Cross products of nearly parallel edges are dropped, as the faces cover them.
    `hint`: the axis to try first, such as that of the last call, because separated hulls mostly stay separated along
    the same axis.
    """
    origin = a.vertices[0]  # far from the origin the dot products would cancel
    first, second = _features(a, origin), _features(b, origin)
    size = float(max(np.ptp(each.points, axis=0).max() for each in (first, second)))
    counts = np.array([len(first.normals), len(second.normals), len(first.edges) * len(second.edges)])
    hint = hint % int(counts.sum())
    every = np.arange(counts.sum())
    stages = [np.array([hint]), *(each[each != hint] for each in np.split(every, np.cumsum(counts)[:-1]))]
    best, axis, number, tested = -np.inf, np.zeros(3), -1, 0
    for stage in filter(len, stages):
        axes, gaps = _gaps(first, second, stage)
        tested += len(stage)
        k = int(gaps.argmax())
        if gaps[k] > best + FACE_PREFERENCE * size:
            best, axis, number = float(gaps[k]), axes[k], int(stage[k])
        if best > 0.0:
            return PolyhedronSat(False, axis, best, number, tested)
    return PolyhedronSat(True, axis, best, number, tested)


class _Features(NamedTuple):
    """points (n, 3), outward unit normals of the faces (m, 3), unit directions of the edges (k, 3)."""

    points: Array
    normals: Array
    edges: Array


def _features(hull: Hull, origin: Array) -> _Features:
    points = hull.vertices - origin
    flat = flat_faces(points, hull.faces)
    corners = points[hull.faces]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    length = np.linalg.norm(normals, axis=1)
    largest = np.lexsort((length, flat.face))  # of each face the largest triangle, which has the least round-off, last
    of_face = largest[np.flatnonzero(np.diff(flat.face[largest], append=-1))]
    start, end = points[flat.edges].swapaxes(0, 1)
    along = end - start
    return _Features(
        points,
        normals[of_face] / np.where(length[of_face] > 0.0, length[of_face], 1.0)[:, None],
        along / np.linalg.norm(along, axis=1, keepdims=True),
    )


def _gaps(a: _Features, b: _Features, which: Indices) -> tuple[Array, Array]:
    """Unit axes (n, 3) from A to B for the indices `which`, and the gaps (n,) along them; -inf for a dropped axis."""
    faces_a, faces = len(a.normals), len(a.normals) + len(b.normals)
    axes = np.zeros((len(which), 3))
    of_a, of_b = which < faces_a, (which >= faces_a) & (which < faces)
    axes[of_a] = a.normals[which[of_a]]
    axes[of_b] = -b.normals[which[of_b] - faces_a]
    i, j = np.divmod(which[which >= faces] - faces, len(b.edges))
    axes[which >= faces] = np.cross(a.edges[i], b.edges[j])
    length = np.linalg.norm(axes, axis=1)
    usable = length * length > PARALLEL_SIN2
    axes[usable] /= length[usable, None]
    onto_a, onto_b = axes @ a.points.T, axes @ b.points.T
    gaps, other = onto_b.min(axis=1) - onto_a.max(axis=1), onto_a.min(axis=1) - onto_b.max(axis=1)
    flipped = (which >= faces) & (other > gaps)  # a cross product may point either way
    axes[flipped] *= -1.0
    return axes, np.where(usable, np.where(flipped, other, gaps), -np.inf)
