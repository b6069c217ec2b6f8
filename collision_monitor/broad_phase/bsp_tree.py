"""Binary space partition of a static solid: locates points, and finds where segments enter the solid.

Each node is the plane of a face; a leaf is either inside or outside. A face that crosses a plane is cut. (Fuchs, Kedem
and Naylor, 1980; Thibault and Naylor, 1987; slides "Spatial partitioning: BSP")
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
"""Thickness of a plane, as part of the solid's size: nearer points count as on it. Smaller: cut corners, which are
rounded, fall on the wrong side of the plane that cut them. Larger: features of that size vanish."""

CANDIDATES: Final = 8
"""Faces tried for the next plane: the face that cuts fewest others wins, then the one with the best balance."""

OUTSIDE: Final = -1
INSIDE: Final = -2
"""Leaves; stored in place of a node's number."""


class BspTree(NamedTuple):
    """Planes normal . x = offset (offset in m) of n nodes, with their children in front (outside) and behind.

    A child is a node or a leaf. Node 0 is the root. thickness (m): nearer points count as on a plane.
    """

    normal: Array  # (n, 3)
    offset: Array  # (n,)
    front: Indices
    back: Indices
    thickness: float


def bsp_tree(vertices: ArrayLike, faces: ArrayLike) -> BspTree:
    """Build the tree of a closed mesh (vertices (n, 3) in m, faces (m, 3)) without self-intersections.

    A scene of disjoint solids is also one mesh. Raises ShapeError.
    """
    vertices, faces = closed_mesh(vertices, faces)
    thickness = THICKNESS * float(np.ptp(vertices[np.unique(faces)], axis=0).max())
    polygons = [corners for corners in vertices[faces] if _plane(corners, thickness) is not None]
    if not polygons:
        raise ShapeError("mesh: expected faces with an area, got none")
    normals: list[Array] = []
    offsets: list[float] = []
    sides: list[list[int]] = []
    todo = [(polygons, -1, 0)]  # polygons to divide, their parent node and its side
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
    """Unit normal and offset (m) of a polygon; None if the polygon is narrower than a plane's thickness."""
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
    """Split polygons into those in front of a plane and those behind it; cut those across it, drop those in it."""
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
    """Masks of the polygons with a part in front of a plane, and of those with a part behind it."""
    height = np.concatenate(polygons) @ normal - offset
    first = np.cumsum([0] + [len(corners) for corners in polygons[:-1]])
    return np.maximum.reduceat(height, first) > thickness, np.minimum.reduceat(height, first) < -thickness


def _cut(corners: Array, height: Array, here: Booleans, there: Booleans) -> Array:
    """Part of a convex polygon on one side of a plane, including the corners on the plane."""
    kept = []
    for k in range(len(corners)):
        after = (k + 1) % len(corners)
        if not there[k]:
            kept.append(corners[k])
        if (here[k] and there[after]) or (there[k] and here[after]):
            kept.append(corners[k] + height[k] / (height[k] - height[after]) * (corners[after] - corners[k]))
    return np.array(kept)


def locate_in_bsp_tree(points: ArrayLike, tree: BspTree) -> Signs:
    """Location (...) of points (..., 3) in m.

    Within the planes' thickness of the surface, it is BOUNDARY or the location on one of the sides.
    """
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
    """Least t (...) in 0 … 1 at which segments p + t (q - p) (..., 3) in m are in the solid or on it; NaN if none."""
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
