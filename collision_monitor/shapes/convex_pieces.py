"""Convex pieces of a shape, which the pair tests work on: one for a convex shape, several for a concave one."""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

from collision_monitor.errors import UnsupportedError
from collision_monitor.geometry.bounded_cache import bounded_cache
from collision_monitor.geometry.point_tree import PointTree
from collision_monitor.geometry.polygons import is_convex
from collision_monitor.geometry.qhull import HEIGHTS_AT_ONCE
from collision_monitor.geometry.triangulation import convex_parts
from collision_monitor.shapes.cells.tiled_solid import TiledSolid
from collision_monitor.shapes.pose import Pose
from collision_monitor.shapes.registry import ConvexHull, Mesh, Points, Polygon, Shape, Triangle
from collision_monitor.shapes.shape import array_bytes
from collision_monitor.tolerances import HULL_DROP

Array = NDArray[np.float64]

REMEMBERED_PIECES: Final = 16 << 20
"""Bytes of pieces that are remembered: those of meshes of 11,000 faces in all. More: memory that hostile meshes can
fill. Less: describing an object cuts its mesh several times."""

FEW_FACES: Final = 16
"""Faces that are compared with all vertices first: of most concave meshes, one of them has vertices on both sides."""

PIECE_BYTES: Final = 1300
"""Memory of a piece with its pose and the pose's rotation (measured with tracemalloc: 1,114 bytes for a triangle)."""


def _memory(pieces: tuple[tuple[Shape, Pose], ...], shape: Shape) -> int:
    return PIECE_BYTES * len(pieces) + array_bytes(shape)


@bounded_cache(REMEMBERED_PIECES, _memory)
def convex_pieces(shape: Shape) -> tuple[tuple[Shape, Pose], ...]:
    """Return the convex pieces of a shape, each with its pose in the shape's frame.

    A concave polygon gives convex parts, a closed convex mesh its hull, any other mesh its triangles. Triangles are
    only the surface, so the inside of a closed mesh needs a separate test (`inside.py`). Shapes are immutable, so the
    result is cached. Raises ShapeError; UnsupportedError for a cloud.
    """
    match shape:
        case Points():
            raise UnsupportedError("Points: a cloud has no convex pieces; supported are the models auto, exact")
        case Polygon() if len(shape.points) > 2 and not is_convex(shape.points):
            return tuple((Polygon(shape.points[part], shape.radius), Pose()) for part in convex_parts(shape.points))
        case Mesh() if is_convex_mesh(shape):
            return ((ConvexHull(shape.vertices[np.unique(shape.surface.faces)]), Pose()),)
        case Mesh():
            corners: NDArray[np.float64] = shape.vertices[shape.faces]
            # a triangle about its own centre has a small bounding sphere and loses no digits
            centres = corners.mean(axis=1)
            return tuple((Triangle(c - m), Pose(m)) for c, m in zip(corners, centres, strict=True))
    return ((shape, Pose()),)


def is_concave_mesh(shape: Shape) -> bool:
    """Whether a shape is a mesh that is not the surface of a convex solid."""
    return isinstance(shape, Mesh) and not is_convex_mesh(shape)


def _own_memory(_: bool, mesh: Mesh) -> int:
    return array_bytes(mesh)


@bounded_cache(REMEMBERED_PIECES, _own_memory)
def is_convex_mesh(mesh: Mesh) -> bool:
    """Whether a mesh bounds a solid and no vertex is outside the plane of any face, up to round-off.

    A map is not asked: its tree answers for it, whatever its cells are.
    """
    if isinstance(mesh, TiledSolid):
        return False
    if not (mesh.surface.closed and len(mesh.surface.faces)):
        return False
    faces = mesh.surface.faces
    a, b, c = np.moveaxis(mesh.vertices[faces], 1, 0)
    normal = np.cross(b - a, c - a)
    length = np.linalg.norm(normal, axis=1)
    size = float(np.ptp(mesh.vertices, axis=0).max())
    if not (length > 0.0).all():
        return False
    normal /= length[:, None]
    used = mesh.vertices[np.unique(faces)]
    offset = np.einsum("ij,ij->i", a, normal)
    flat = HULL_DROP * 16 * size
    # all faces must point outward, or all inward, and the mesh must not be a sheet folded onto itself
    outward = inward = True
    first, last = 0, FEW_FACES
    small = len(used) * len(normal) <= HEIGHTS_AT_ONCE
    while first < (len(normal) if small else FEW_FACES):
        some, first = slice(first, last), last
        last += max(HEIGHTS_AT_ONCE // len(used), FEW_FACES)
        height = used @ normal[some].T - offset[some]
        low, high = height.min(axis=0), height.max(axis=0)
        outward = outward and bool((high <= flat).all() and (low < -flat).all())
        inward = inward and bool((low >= -flat).all() and (high > flat).all())
        if not (outward or inward):
            return False
    if small:
        return True
    return _is_below_planes(mesh, normal if outward else -normal, offset if outward else -offset, flat)


def _is_below_planes(mesh: Mesh, normal: Array, offset: Array, flat: float) -> bool:
    """Whether no vertex is higher than `flat` (m) over the plane of any face, and one is deeper below each plane."""
    faces, which = np.unique(mesh.surface.faces, return_inverse=True)
    used, which = mesh.vertices[faces], which.ravel()
    # the normals of the faces at each vertex together are about normal to the surface
    upward = np.zeros_like(used)
    for c in range(3):
        upward[:, c] = np.bincount(which, np.repeat(normal[:, c], 3), len(used))
    tree, rows = PointTree(used, upward), np.column_stack([used, np.zeros(len(used))])
    above = tree.exceeds(normal, offset + flat, rows, offset + flat, stop=True)
    return not above.any() and bool(tree.exceeds(-normal, flat - offset, rows, flat - offset).all())
