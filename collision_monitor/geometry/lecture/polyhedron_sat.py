"""Separating axis test of two convex polyhedra, which tries the axis of the last call first.

The monitor tests boxes with narrow_phase/box_box.py, the same test compiled, and hulls with GJK and EPA, which do not
examine every pair of edges.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from collision_monitor.geometry.bounding_volumes import Hull
from collision_monitor.geometry.coordinates import Array, Indices
from collision_monitor.geometry.polyhedra import mesh_edges
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
    of the faces and the cross products of the edges. Cross products of nearly parallel edges are dropped, as the faces
    cover them. `hint`: the axis to try first, such as that of the last call, because separated hulls mostly stay
    separated along the same axis.
    """
    origin = a.vertices[0]  # far from the origin the dot products would cancel
    first, second = a.vertices - origin, b.vertices - origin
    size = float(max(np.ptp(first, axis=0).max(), np.ptp(second, axis=0).max()))
    counts = np.array([len(a.faces), len(b.faces), len(mesh_edges(a.faces)) * len(mesh_edges(b.faces))])
    hint = hint % int(counts.sum())
    stages = [np.array([hint]), *np.split(np.arange(counts.sum()), np.cumsum(counts)[:-1])]
    best, axis, number, tested = -np.inf, np.zeros(3), -1, 0
    for stage in stages:
        axes, gaps = _gaps(a, b, first, second, stage, counts)
        tested += len(stage)
        k = int(gaps.argmax())
        if gaps[k] > best + FACE_PREFERENCE * size:
            best, axis, number = float(gaps[k]), axes[k], int(stage[k])
        if best > 0.0:
            return PolyhedronSat(False, axis, best, number, tested)
    return PolyhedronSat(True, axis, best, number, tested)


def _gaps(a: Hull, b: Hull, first: Array, second: Array, which: Indices, counts: Indices) -> tuple[Array, Array]:
    """Unit axes (n, 3) from A to B for the indices `which`, and the gaps (n,) along them; -inf for a dropped axis."""
    faces_a, faces_b = int(counts[0]), int(counts[0] + counts[1])
    edges_a, edges_b = (_edges(hull.faces, points) for hull, points in ((a, first), (b, second)))
    axes = np.zeros((len(which), 3))
    of_a, of_b = which < faces_a, (which >= faces_a) & (which < faces_b)
    axes[of_a] = _normals(first[a.faces[which[of_a]]])
    axes[of_b] = -_normals(second[b.faces[which[of_b] - faces_a]])
    i, j = np.divmod(which[which >= faces_b] - faces_b, len(edges_b))
    axes[which >= faces_b] = np.cross(edges_a[i], edges_b[j])
    length = np.linalg.norm(axes, axis=1)
    usable = length * length > PARALLEL_SIN2
    axes[usable] /= length[usable, None]
    onto_a, onto_b = axes @ first.T, axes @ second.T
    gaps, other = onto_b.min(axis=1) - onto_a.max(axis=1), onto_a.min(axis=1) - onto_b.max(axis=1)
    flipped = (which >= faces_b) & (other > gaps)  # a cross product may point either way
    axes[flipped] *= -1.0
    return axes, np.where(usable, np.where(flipped, other, gaps), -np.inf)


def _edges(faces: Indices, points: Array) -> Array:
    start, end = points[mesh_edges(faces)].swapaxes(0, 1)
    return np.asarray((end - start) / np.linalg.norm(end - start, axis=1, keepdims=True))


def _normals(corners: Array) -> Array:
    """Outward unit normals (n, 3) of triangles (n, 3, 3); zero for a triangle without area."""
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    length = np.linalg.norm(normal, axis=1, keepdims=True)
    return np.asarray(normal / np.where(length > 0.0, length, 1.0))
