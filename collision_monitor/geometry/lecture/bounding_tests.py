"""Tests between bounding volumes: true if they overlap or touch.

All are vectorised over the leading dimensions of the volumes' fields. They are conservative: if round-off could hide a
touch, they return true, because a rejected pair is never examined again.
"""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import ArrayLike

from collision_monitor.errors import InputError, ShapeError
from collision_monitor.geometry.bounding_volumes import Aabb, BoundingSphere, Kdop, Obb
from collision_monitor.geometry.coordinates import Array, Booleans, coordinates, point_set
from collision_monitor.geometry.polygons import is_convex, polygon_corners
from collision_monitor.geometry.triangulation import triangulate
from collision_monitor.tolerances import EPSILON, PARALLEL_SIN2, SAT_ROUND_OFF

PLANAR: Final = 1e-9
"""Largest distance of a polygon's corner from its plane, as part of its size. Larger: the result may be that of another
polygon. Smaller: polygons that were rotated in float32 are refused."""


def spheres_overlap(a: BoundingSphere, b: BoundingSphere) -> Booleans:
    """Whether spheres overlap: distance of the centres <= sum of the radii, squared to avoid the root.

    (Slides "Collisions Detection Between Spheres", "Sphere vs. Sphere")
    """
    return _within(b.center - a.center, a.radius + b.radius)


def circle_circle(a: BoundingSphere, b: BoundingSphere) -> Booleans:
    """Whether circles overlap: sphere_sphere with centres (..., 2). (Slide "Collisions Detection Between Circles")"""
    coordinates(a.center, "circle a: center", 2)
    coordinates(b.center, "circle b: center", 2)
    return spheres_overlap(a, b)


def aabb_aabb(a: Aabb, b: Aabb) -> Booleans:
    """Whether axis-aligned boxes overlap on every axis; exact. (Slides "AABB vs. AABB")"""
    return np.asarray(((a.lower <= b.upper) & (b.lower <= a.upper)).all(axis=-1))


def closest_point_in_aabb(p: ArrayLike, box: Aabb) -> Array:
    """Points of boxes closest to p (..., 2 or 3) in m: each coordinate clamped. (Slide "Sphere vs. AABB – clamping")"""
    return np.clip(coordinates(p, "p"), box.lower, box.upper)


def sphere_aabb(sphere: BoundingSphere, box: Aabb) -> tuple[Booleans, Array]:
    """Whether a sphere overlaps a box, and the box's closest point to it. (Slides "Sphere vs. AABB – closest point")"""
    closest = closest_point_in_aabb(sphere.center, box)
    return _within(closest - sphere.center, sphere.radius), closest


def sphere_obb(sphere: BoundingSphere, box: Obb) -> tuple[Booleans, Array]:
    """Whether a sphere overlaps an oriented box, and the box's closest point, clamped in its frame. (Ericson, 5.2.6)"""
    p_B = _turn(np.swapaxes(box.rotation, -1, -2), sphere.center - box.center)
    closest_B = np.clip(p_B, -box.half_extents, box.half_extents)
    # the rotation is wrong by a few round-offs of the distance between the centres
    slack = 8 * EPSILON * np.abs(p_B).max(axis=-1)
    overlap = _within(closest_B - p_B, sphere.radius + slack)
    return overlap, np.asarray(box.center + _turn(box.rotation, closest_B))


def obb_obb(a: Obb, b: Obb) -> Booleans:
    """Whether oriented boxes overlap, by SAT: no face normal and no cross product of edges separates them.

    (Slides "Oriented bounding box", "Separating Axis Theorem (SAT)"; Gottschalk, Lin, Manocha, 1996.
    narrow_phase/box_box.py also computes the depth and contact points.)
    """
    R_AB = np.swapaxes(a.rotation, -1, -2) @ b.rotation
    offset = _turn(np.swapaxes(a.rotation, -1, -2), np.asarray(b.center - a.center))
    faces_a = np.broadcast_to(np.eye(3), R_AB.shape)
    faces_b = np.swapaxes(R_AB, -1, -2)
    crossed = np.cross(faces_a[..., :, None, :], faces_b[..., None, :, :]).reshape(*R_AB.shape[:-2], 9, 3)
    axes = np.concatenate([faces_a, faces_b, crossed], axis=-2)
    reach = _turn(np.abs(axes), a.half_extents) + _turn(np.abs(axes @ R_AB), b.half_extents)
    size = np.abs(offset).max(axis=-1) + a.half_extents.max(axis=-1) + b.half_extents.max(axis=-1)
    apart = np.abs(_turn(axes, offset)) > reach + SAT_ROUND_OFF * size[..., None]
    return np.asarray(~(apart & ((axes * axes).sum(axis=-1) > PARALLEL_SIN2)).any(axis=-1))


def kdop_kdop(a: Kdop, b: Kdop) -> Booleans:
    """Whether k-DOPs overlap in every slab. True does not prove that they meet; false proves that they do not.

    Raises InputError if their directions differ.
    """
    if not np.array_equal(a.directions, b.directions):
        got = f"{len(a.directions)} and {len(b.directions)} that differ"
        raise InputError(f"k-DOPs: expected the same directions for both, got {got}")
    return np.asarray(((a.lower <= b.upper) & (b.lower <= a.upper)).all(axis=-1))


def obb_polygon(box: Obb, polygon: ArrayLike) -> bool:
    """Whether an oriented box meets a flat polygon (n, 3) in space, by SAT; a concave polygon is split into triangles.

    (Slide "Oriented bounding boxes and arbitrary polygons: Separating axis theorem".) The axes are the box's three
    axes, the polygon's normal and the cross products of their edges. Raises ShapeError if the corners are not in one
    plane.
    """
    corner = point_set(polygon, "polygon", 3, least=3)
    p_B = _turn(box.rotation.T, corner - box.center)
    offset = p_B - p_B[0]
    normal = 0.5 * np.cross(offset, np.roll(offset, -1, axis=0)).sum(axis=0)  # Newell: also correct for concave ones
    size = float(np.abs(offset).max())
    area = float(np.linalg.norm(normal))
    if not area > PLANAR * size**2:
        raise ShapeError("polygon: expected an area, got corners on one line")
    normal = normal / area
    if np.abs(offset @ normal).max() > PLANAR * size:
        raise ShapeError("polygon: expected corners in one plane; split it into triangles")
    along = np.abs(normal).argmax()
    flat = np.delete(offset, along, axis=1)
    parts = [polygon_corners(flat)] if is_convex(flat) else list(triangulate(flat))
    return any(_box_meets_convex(box.half_extents, p_B[part], normal) for part in parts)


def _box_meets_convex(half: Array, corner: Array, normal: Array) -> bool:
    edges = np.roll(corner, -1, axis=0) - corner
    edges = edges / np.linalg.norm(edges, axis=1, keepdims=True)
    crossed = np.cross(edges[:, None], np.eye(3)).reshape(-1, 3)
    length2 = (crossed * crossed).sum(axis=1)
    crossed = crossed[length2 > PARALLEL_SIN2] / np.sqrt(length2[length2 > PARALLEL_SIN2])[:, None]
    axes = np.vstack([np.eye(3), normal, crossed])
    dots = axes @ corner.T
    reach = np.abs(axes) @ half
    round_off = SAT_ROUND_OFF * (np.abs(corner).max() + half.max())
    return bool(((dots.min(axis=1) <= reach + round_off) & (dots.max(axis=1) >= -reach - round_off)).all())


def _within(offset: Array, reach: Array) -> Booleans:
    return np.asarray((offset * offset).sum(axis=-1) <= reach * reach * (1 + 8 * EPSILON))


def _turn(rotation: Array, vector: Array) -> Array:
    return np.asarray((rotation @ vector[..., None])[..., 0])
