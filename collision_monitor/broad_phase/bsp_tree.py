"""Binary space partition of a static solid: where points are, and where segments enter it.

Each node is the plane of a face; a leaf is all inside or all outside. Faces across a plane are cut. (Fuchs, Kedem and
Naylor, 1980; Thibault and Naylor, 1987; slides "Spatial partitioning: BSP")
"""

from __future__ import annotations

from typing import Final, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from collision_monitor.errors import InputError, ShapeError
from collision_monitor.geometry.coordinates import Array, Booleans, Indices, Signs, coordinates
from collision_monitor.geometry.point_in_polygon import Location
from collision_monitor.geometry.polyhedra import closed_mesh

THICKNESS: Final = 1e-9
"""Of a plane, as part of the solid's size: what is nearer counts as on it. Smaller: cut corners, which are rounded,
fall on the wrong side of the plane that cut them. Larger: features of that size vanish."""

CANDIDATES: Final = 8
"""Faces that are tried for the next plane: the one that cuts fewest, then halves best, is taken."""

OUTSIDE: Final = -1
INSIDE: Final = -2
"""Leaves, in place of the number of a node."""


class BspTree(NamedTuple):
    """Planes normal . x = offset of n nodes, and what is in front (outside) and behind: nodes or leaves.

    Node 0 is first. thickness (m): nearer points are on a plane.
    """

    normal: Array  # (n, 3)
    offset: Array  # (n,)
    front: Indices
    back: Indices
    thickness: float


def bsp_tree(vertices: ArrayLike, faces: ArrayLike) -> BspTree:
    """The tree of a closed mesh (vertices (n, 3) in m, faces (m, 3)) whose surface does not cross itself.

    A scene of solids that do not meet is one such mesh. Raises ShapeError.
    """
    vertices, faces = closed_mesh(vertices, faces)
    thickness = THICKNESS * float(np.ptp(vertices[np.unique(faces)], axis=0).max())
    polygons = [corners for corners in vertices[faces] if _plane(corners, thickness) is not None]
    if not polygons:
        raise ShapeError("mesh: expected faces with an area, got none")
    normals: list[Array] = []
    offsets: list[float] = []
    sides: list[list[int]] = []
    todo = [(polygons, -1, 0)]  # what is to be divided, and the node and side that it belongs to
    while todo:
        polygons, above, side = todo.pop()
        if above >= 0:
            sides[above][side] = len(normals)
        normal, offset = _best_plane(polygons, thickness)
        normals.append(normal)
        offsets.append(offset)
        sides.append([OUTSIDE, INSIDE])
        for side, part in enumerate(_divided(polygons, normal, offset, thickness)):
            if part:
                todo.append((part, len(normals) - 1, side))
    front, back = np.array(sides).T
    return BspTree(np.array(normals), np.array(offsets), front, back, thickness)


def _plane(corners: Array, thickness: float) -> tuple[Array, float] | None:
    """Unit normal and offset of a polygon; None for one that is no wider than a plane is thick."""
    offset = corners - corners[0]
    normal = np.cross(offset[1:-1], offset[2:]).sum(axis=0)
    length, size = float(np.linalg.norm(normal)), float(np.linalg.norm(offset, axis=1).max())
    if not length > thickness * size:
        return None
    normal = normal / length
    return normal, float(normal @ corners.mean(axis=0))


def _best_plane(polygons: list[Array], thickness: float) -> tuple[Array, float]:
    some = [polygons[k] for k in np.unique(np.linspace(0, len(polygons) - 1, CANDIDATES).astype(int))]
    planes = [plane for corners in some if (plane := _plane(corners, thickness)) is not None]
    cost = []
    for normal, offset in planes:
        before, behind = _sides(polygons, normal, offset, thickness)
        cost.append(4 * int((before & behind).sum()) + abs(int(before.sum()) - int(behind.sum())))
    return planes[int(np.argmin(cost))]


def _divided(polygons: list[Array], normal: Array, offset: float, thickness: float) -> tuple[list[Array], list[Array]]:
    """What is in front of a plane and behind it; polygons in it are done with, those across it are cut."""
    before, behind = _sides(polygons, normal, offset, thickness)
    front = [polygons[k] for k in np.flatnonzero(before & ~behind)]
    back = [polygons[k] for k in np.flatnonzero(behind & ~before)]
    for corners in (polygons[k] for k in np.flatnonzero(before & behind)):
        height = corners @ normal - offset
        here, there = height > thickness, height < -thickness
        for part, piece in ((front, _cut(corners, height, here, there)), (back, _cut(corners, height, there, here))):
            if _plane(piece, thickness) is not None:
                part.append(piece)
    return front, back


def _sides(polygons: list[Array], normal: Array, offset: float, thickness: float) -> tuple[Booleans, Booleans]:
    """Which polygons have a part in front of a plane, and which behind it."""
    height = np.concatenate(polygons) @ normal - offset
    first = np.cumsum([0] + [len(corners) for corners in polygons[:-1]])
    return np.maximum.reduceat(height, first) > thickness, np.minimum.reduceat(height, first) < -thickness


def _cut(corners: Array, height: Array, here: Booleans, there: Booleans) -> Array:
    """The part of a convex polygon on one side, corners on the plane included."""
    kept = []
    for k in range(len(corners)):
        after = (k + 1) % len(corners)
        if not there[k]:
            kept.append(corners[k])
        if (here[k] and there[after]) or (there[k] and here[after]):
            kept.append(corners[k] + height[k] / (height[k] - height[after]) * (corners[after] - corners[k]))
    return np.array(kept)


def locate_in_bsp_tree(points: ArrayLike, tree: BspTree) -> Signs:
    """Location (...) of points (..., 3); within the planes' thickness of the surface: BOUNDARY, or one of its sides."""
    points = coordinates(points, "points", 3)
    p = points.reshape(-1, 3)
    met = np.zeros((2, len(p)), bool)  # outside, inside
    todo = [(0, np.arange(len(p)))]
    while todo:
        node, which = todo.pop()
        height = p[which] @ tree.normal[node] - tree.offset[node]
        for child, part in ((tree.front[node], height >= -tree.thickness), (tree.back[node], height <= tree.thickness)):
            if child < 0:
                met[int(child == INSIDE), which[part]] = True
            elif part.any():
                todo.append((int(child), which[part]))
    outside, inside = met
    location = np.where(inside & outside, Location.BOUNDARY, np.where(inside, Location.INSIDE, Location.OUTSIDE))
    return location.reshape(points.shape[:-1]).astype(np.int8)


def first_hit(p: ArrayLike, q: ArrayLike, tree: BspTree) -> Array:
    """The least t (...) from 0 to 1 at which segments p + t (q - p) (..., 3) are in the solid or on it; NaN if none."""
    p, q = coordinates(p, "p", 3), coordinates(q, "q", 3)
    try:
        p, q = np.broadcast_arrays(p, q)
    except ValueError:
        raise InputError(f"expected shapes that broadcast, got {p.shape}, {q.shape}") from None
    shape = p.shape[:-1]
    p, u = p.reshape(-1, 3), (q - p).reshape(-1, 3)
    hit = np.full(len(p), np.inf)
    todo = [(0, np.arange(len(p)), np.zeros(len(p)), np.ones(len(p)))]
    while todo:
        node, which, t0, t1 = todo.pop()
        start = p[which] @ tree.normal[node] - tree.offset[node]
        slope = u[which] @ tree.normal[node]
        for child, sign in ((int(tree.front[node]), 1.0), (int(tree.back[node]), -1.0)):
            # the part of t0 … t1 with sign * (start + t slope) >= -thickness
            s, g = sign * start + tree.thickness, sign * slope
            crossing = -s / np.where(g == 0.0, 1.0, g)
            begin = np.where(g > 0.0, np.maximum(t0, crossing), t0)
            end = np.where(g < 0.0, np.minimum(t1, crossing), t1)
            part = (begin <= end) & ((g != 0.0) | (s >= 0.0))
            if child == INSIDE:
                np.minimum.at(hit, which[part], begin[part])
            elif child >= 0 and part.any():
                todo.append((child, which[part], begin[part], end[part]))
    return np.where(np.isfinite(hit), hit, np.nan).reshape(shape)
