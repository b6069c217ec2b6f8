"""Convex pieces of an object as arrays, and the tree of spheres around them that `contact` searches."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Final

import numpy as np
from numpy.typing import NDArray

from collision_monitor.broad_phase.aabb_tree import aabb_tree
from collision_monitor.geometry.bounded_cache import bounded_cache
from collision_monitor.shapes.convex_pieces import convex_pieces, is_convex_mesh
from collision_monitor.shapes.pose import Pose
from collision_monitor.shapes.registry import Mesh, Polygon, Shape, kind_of
from collision_monitor.shapes.shape import array_bytes
from collision_monitor.shapes.shape_table import ShapeTable, ShapeTableBuilder, join, triangle_table

Array = NDArray[np.float64]
Indices = NDArray[np.int64]

REMEMBERED_CONVEX: Final = 16 << 20
REMEMBERED_CONCAVE: Final = 256 << 20
"""Bytes of the tables that are remembered: of concave meshes, 200,000 faces in all. Less: `contact` of meshes that take
turns makes their tables at each call, 1 s for 100,000 faces."""

TABLE_BYTES: Final = 5000
ROW_BYTES: Final = 900
"""Memory of a table beside its vertices and of each of its rows, with the spheres (measured with tracemalloc)."""


@dataclass(frozen=True, eq=False)
class SphereLevels:
    """Tree of spheres: level k has 2^k, center[k] (2^k, 3) and radius[k] (m), each around two of the next level.

    Sphere m of the last level holds one or two pieces, order[first[m]] … order[first[m + 1] - 1].
    """

    center: list[Array]
    radius: list[Array]
    order: Indices
    first: Indices


@dataclass(frozen=True, eq=False)
class PieceTable:
    """n convex pieces: a table of their shapes, and their poses (n, 3), (n, 3, 3) in the object's frame.

    inner (m, 3): points of the pieces (m), at least one of each connected part.
    """

    table: ShapeTable
    position: Array
    rotation: Array
    inner: Array

    def __len__(self) -> int:
        return len(self.position)

    @cached_property
    def spheres(self) -> SphereLevels:
        """Spheres around the pieces' bounding spheres, halved by position. (Slides "Bounding volume hierarchies")"""
        tree = aabb_tree(self.position, self.position)
        n = len(self.position)
        position, radius = self.position[tree.order], self.table.radius[tree.order]
        centers, radii = [], []
        for k, (low, high) in enumerate(zip(tree.lower, tree.upper, strict=True)):
            center = low + 0.5 * (high - low)
            first = np.arange(2**k) * n >> k
            node = np.repeat(np.arange(2**k), np.diff(first, append=n))
            far = np.linalg.norm(position - center[node], axis=1) + radius
            centers.append(center)
            radii.append(np.maximum.reduceat(far, first))
        return SphereLevels(centers, radii, tree.order, tree.first)


def exact_piece_table(shapes: Sequence[tuple[Shape, Pose]]) -> PieceTable:
    """Pieces of an object with its exact shapes. They are cached, because a shape never changes."""
    parts = []
    for shape, pose in shapes:
        own = _of_concave(shape) if isinstance(shape, Mesh | Polygon) else _of_convex(shape)
        if pose.position.any() or pose.quaternion[3] != 1.0:
            R = pose.rotation
            turned = (own.position @ R.T + pose.position, R @ own.rotation, own.inner @ R.T + pose.position)
            own = PieceTable(own.table, *turned)
        parts.append(own)
    if len(parts) == 1:
        return parts[0]
    columns = ([getattr(part, name) for part in parts] for name in ("position", "rotation", "inner"))
    return PieceTable(join([part.table for part in parts]), *map(np.concatenate, columns))


def _memory(table: PieceTable, shape: Shape) -> int:
    return TABLE_BYTES + ROW_BYTES * len(table) + table.table.vertices.nbytes + array_bytes(shape)


@bounded_cache(REMEMBERED_CONVEX, _memory)
def _of_convex(shape: Shape) -> PieceTable:
    return piece_table(((shape, Pose()),))


@bounded_cache(REMEMBERED_CONCAVE, _memory)
def _of_concave(shape: Mesh | Polygon) -> PieceTable:
    if isinstance(shape, Mesh) and not is_convex_mesh(shape):
        corners = shape.vertices[shape.faces]
        # relative to its own centre, a triangle has a small bounding sphere and keeps its digits
        centers = corners.mean(axis=1)
        rotation = np.tile(np.eye(3), (len(corners), 1, 1))
        inner = centers[_one_of_each_part(shape.faces, len(shape.vertices))]
        return PieceTable(triangle_table(corners - centers[:, None]), centers, rotation, inner)
    return piece_table(convex_pieces(shape))


def _one_of_each_part(faces: Indices, vertices: int) -> Indices:
    """Index of one face of each connected part of a mesh."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    start, end = faces.ravel(), np.roll(faces, -1, axis=1).ravel()
    graph = coo_array((np.ones(len(start), np.int8), (start, end)), shape=(vertices, vertices))
    _, part = connected_components(graph, directed=False)
    return np.asarray(np.unique(part[faces[:, 0]], return_index=True)[1])


def piece_table(pieces: Sequence[tuple[Shape, Pose]]) -> PieceTable:
    """Table of convex shapes with their poses in the object's frame."""
    builder = ShapeTableBuilder(slots=len(pieces), vertices=0)
    for shape, _ in pieces:
        builder.append(shape)
    position = np.stack([pose.position for _, pose in pieces])
    rotation = np.stack([pose.rotation for _, pose in pieces])
    middle = np.array([_middle(shape) for shape, _ in pieces])
    return PieceTable(builder.used, position, rotation, position + np.einsum("nij,nj->ni", rotation, middle))


def _middle(shape: Shape) -> Array:
    """A point (3,) of a convex shape, in its own frame."""
    middle = kind_of(shape).middle
    return np.zeros(3) if middle is None else middle(shape)
