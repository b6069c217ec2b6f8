"""Cascade of tests for two polyhedra: bounding volumes, then vertices, then edges against faces.

(Slide "Order tests according to computational complexity and power of detection")
"""

from __future__ import annotations

from enum import Enum
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from collision_monitor.geometry.bounding_volumes import aabb
from collision_monitor.geometry.coordinates import Array, Indices
from collision_monitor.geometry.lecture.bounding_tests import aabb_aabb
from collision_monitor.geometry.point_in_polygon import Location
from collision_monitor.geometry.polyhedra import closed_mesh, edge_face, locate_in_polyhedron, mesh_edges


class CascadeStage(Enum):
    """Stage of the cascade that decided the result."""

    BOUNDING_VOLUMES = "bounding volumes"
    VERTICES = "vertices"
    EDGES_AND_FACES = "edges against faces"


class CascadeResult(NamedTuple):
    """collides: touching counts. stage: the stage that decided the result.

    vertices_a, vertices_b (k,): vertices of A in B and of B in A. edges_a, edges_b (k, 3): for each crossing, the two
    vertices of the edge and the index of the other mesh's face. Only the deciding stage fills its fields.
    """

    collides: bool
    stage: CascadeStage
    vertices_a: Indices
    vertices_b: Indices
    edges_a: Indices
    edges_b: Indices


def polyhedra_intersect(
    vertices_a: ArrayLike, faces_a: ArrayLike, vertices_b: ArrayLike, faces_b: ArrayLike
) -> CascadeResult:
    """Whether two closed meshes, convex or not, in one frame (vertices (n, 3), faces (m, 3)), have a point in common.

    A stage ends the cascade if it decides: separate boxes, a vertex of one inside the other, an edge through a face.
    The last stage also finds crossed bars, which have no vertex inside each other. Exact. Raises ShapeError.
    """
    points_a, corners_a = closed_mesh(vertices_a, faces_a, "mesh A")
    points_b, corners_b = closed_mesh(vertices_b, faces_b, "mesh B")
    none, no_edges = np.zeros(0, np.int64), np.zeros((0, 3), np.int64)
    used_a, used_b = np.unique(corners_a), np.unique(corners_b)
    box_a, box_b = aabb(points_a[used_a]), aabb(points_b[used_b])
    if not aabb_aabb(box_a, box_b):
        return CascadeResult(False, CascadeStage.BOUNDING_VOLUMES, none, none, no_edges, no_edges)
    inside_b = _inside(points_a, used_a, points_b, corners_b)
    inside_a = _inside(points_b, used_b, points_a, corners_a)
    if len(inside_a) or len(inside_b):
        return CascadeResult(True, CascadeStage.VERTICES, inside_b, inside_a, no_edges, no_edges)
    edges_a = _crossings(points_a, mesh_edges(corners_a), points_b, corners_b)
    edges_b = _crossings(points_b, mesh_edges(corners_b), points_a, corners_a)
    return CascadeResult(bool(len(edges_a) or len(edges_b)), CascadeStage.EDGES_AND_FACES, none, none, edges_a, edges_b)


def _inside(points: Array, used: Indices, vertices: Array, faces: Indices) -> Indices:
    return used[locate_in_polyhedron(points[used], vertices, faces) != Location.OUTSIDE]


def _crossings(points: Array, edges: Indices, vertices: Array, faces: Indices) -> Indices:
    """Edges that meet faces, as rows (edge vertex, edge vertex, face)."""
    p, q = points[edges[:, 0]], points[edges[:, 1]]
    low, high = np.minimum(p, q), np.maximum(p, q)
    face_low, face_high = vertices[faces].min(axis=1), vertices[faces].max(axis=1)
    found = [np.zeros((0, 3), np.int64)]
    for first in range(0, len(edges), 1024):  # batches, so that the table of edges against faces stays small
        some = slice(first, first + 1024)
        i, j = np.nonzero(((low[some, None] <= face_high) & (face_low <= high[some, None])).all(axis=-1))
        if len(i):
            i = i + first
            meets = edge_face(p[i], q[i], *vertices[faces[j].T]).meets
            found.append(np.column_stack([edges[i[meets]], j[meets]]))
    return np.concatenate(found)
