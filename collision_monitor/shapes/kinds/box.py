"""The box."""

from __future__ import annotations

from dataclasses import dataclass
from math import hypot, sqrt
from typing import Any, Final

import numpy as np

from collision_monitor._jit import device, inlined
from collision_monitor.errors import ShapeError
from collision_monitor.geometry.contact_features import Feature, FeatureType, mesh_feature_at
from collision_monitor.geometry.vector import Vector, dot
from collision_monitor.records import ShapeType
from collision_monitor.shapes.feature_types import EDGE, FACE, VERTEX
from collision_monitor.shapes.kind import Fields, Kind, Row
from collision_monitor.shapes.mass import MassProperties
from collision_monitor.shapes.rays import RayInterval, planes_interval
from collision_monitor.shapes.shape import Array, Shape, full_extents
from collision_monitor.shapes.surface_parts import UNIT_CORNERS, box_triangles

BOX: Final = int(ShapeType.BOX)

# Corners of a unit box, numbered by their sides as bits (x, y, z); its faces +x -x +y -y +z -z, two triangles each.
_SIDES: Final = np.array([[(k >> axis & 1) - 0.5 for axis in range(3)] for k in range(8)])
_QUADS: Final = np.array([[1, 3, 7, 5], [0, 4, 6, 2], [2, 6, 7, 3], [0, 1, 5, 4], [4, 5, 7, 6], [0, 2, 3, 1]])
_TRIANGLES: Final = _QUADS[:, [[0, 1, 2], [0, 2, 3]]].reshape(-1, 3)
_DIAGONALS: Final = [(int(min(q[0], q[2])), int(max(q[0], q[2]))) for q in _QUADS]
"""The edge between the two triangles of each face, which is no edge of the box."""


@dataclass(frozen=True, init=False)
class Box(Shape):
    """Box; size: full extents (x, y, z) in m. Zero extents are allowed (a plate, a needle), but not all three.

    >>> Box((1, 2, 3)).size
    (1.0, 2.0, 3.0)
    """

    size: Any

    def __init__(self, size: Any, *others: Any) -> None:
        if others:  # three numbers in place of one size
            raise ShapeError(f"Box: expected one size, got {1 + len(others)} arguments; write Box((x, y, z))")
        self.__dict__["size"] = full_extents(size, "Box size", "Box((1, 1, 1))")

    @property
    def corners(self) -> Array:
        """The eight corners (8, 3) in m."""
        return UNIT_CORNERS * np.array(self.size)


@inlined
def box_support_point(half: Vector, d: Vector) -> Vector:
    """Farthest corner along d."""
    x, y, z = half
    return x if d[0] > 0.0 else -x, y if d[1] > 0.0 else -y, z if d[2] > 0.0 else -z


@inlined
def box_support(half: Vector, x: float, y: float, z: float) -> float:
    """Return max m . p over the points p of a box by its half extents (m), for m = (x, y, z) of any length."""
    return abs(x) * half[0] + abs(y) * half[1] + abs(z) * half[2]


@device
def box_distance(half: Vector, x: Vector) -> tuple[float, Vector]:
    """Signed distance (m) of a point from a box by its half extents (m), and its direction out of the box."""
    gx, gy, gz = abs(x[0]) - half[0], abs(x[1]) - half[1], abs(x[2]) - half[2]
    sx, sy, sz = (-1.0 if x[0] < 0.0 else 1.0), (-1.0 if x[1] < 0.0 else 1.0), (-1.0 if x[2] < 0.0 else 1.0)
    w = max(gx, 0.0), max(gy, 0.0), max(gz, 0.0)
    length = sqrt(dot(w, w))
    if length > 0.0:
        return length, (sx * w[0] / length, sy * w[1] / length, sz * w[2] / length)
    if gx >= gy and gx >= gz:
        return gx, (sx, 0.0, 0.0)
    if gy >= gz:
        return gy, (0.0, sy, 0.0)
    return gz, (0.0, 0.0, sz)


@device
def box_feature(half: Vector, x: Vector, n: Vector, reach: float) -> tuple[float, float]:
    """Type and index of the feature at a point x of the surface for an outward normal n, numbered as in box_box.py.

    reach (m): heights and distances up to it count as 0.
    """
    gap = (half[0] - abs(x[0]), half[1] - abs(x[1]), half[2] - abs(x[2]))
    outermost = max(min(gap[0], min(gap[1], gap[2])), reach)  # the point is at this side, even if it is below it
    sides, level, beside, last = 0, 0, 0, 0  # as bits: at a side; along it a corner is as high as the other; positive
    for c in range(3):
        if gap[c] <= outermost:
            sides |= 1 << c
        else:
            last = c
        if 2.0 * half[c] * abs(n[c]) <= reach:
            level |= 1 << c
        if (n[c] if half[c] <= reach else x[c]) > 0.0:
            beside |= 1 << c
    for c in range(3):
        upward = (n[c] > 0.0) == (beside >> c & 1 == 1)
        if sides >> c & 1 and level | 1 << c == 7 and upward:
            return FACE, 2.0 * c + (0.0 if beside >> c & 1 else 1.0)
    edge = -1
    for c in range(3):
        if level >> c & 1 and sides | 1 << c == 7:
            edge = c
    if edge < 0 and sides == 7:
        return VERTEX, float(beside)
    if edge < 0 and sides | 1 << last == 7:
        edge = last
    if edge >= 0:
        return EDGE, 4.0 * edge + (beside >> (edge + 1) % 3 & 1) + 2.0 * (beside >> (edge + 2) % 3 & 1)
    c = 0 if sides & 1 else (1 if sides & 2 else 2)
    return FACE, 2.0 * c + (0.0 if beside >> c & 1 else 1.0)


def _side(face: int) -> Feature:
    return Feature(FeatureType.FACE, tuple(_QUADS[face].tolist()), face)


def feature_of_box(size: Array, point: Array, normal: Array, tie: float, off: float) -> Feature:
    """Feature of a box by its extents (3,): corners numbered by their sides (bit 0: +x, …), faces +x -x +y -y +z -z."""
    found = mesh_feature_at(point, normal, _SIDES * size, _TRIANGLES, tie, off)
    if found.type is FeatureType.FACE:
        return _side(found.face // 2)
    if found.type is FeatureType.EDGE and found.vertices in _DIAGONALS:
        return _side(_DIAGONALS.index(found.vertices))
    return found


def box_interval(half: Array, p: Array, d: Array) -> RayInterval:
    """Part of each ray in a box by its half extents (3,)."""
    return planes_interval(np.concatenate([np.eye(3), -np.eye(3)]), np.tile(half, 2), p, d)


def box_mass(size: tuple[float, ...], density: float) -> MassProperties | None:
    """Mass properties of a box by its extents; None for a plate."""
    if not min(size) > 0.0:
        return None
    mass, squares = density * float(np.prod(size)), np.square(size)
    return MassProperties(mass, np.zeros(3), np.diag(mass / 12 * (squares.sum() - squares)))


def _row(shape: Box, _: Any) -> Row:
    x, y, z = shape.size
    half = x / 2, y / 2, z / 2
    return Row(BOX, half, hypot(*half))  # size: half extents


KIND: Final = Kind(
    number=ShapeType.BOX,
    name="box",
    shape=Box,
    dimensions="x, y, z",
    fields=lambda shape: Fields(tuple(shape.size)),
    make=lambda fields: Box(fields.dimensions),
    row=_row,
    support=lambda shape, d: np.asarray(np.abs(d) @ (np.array(shape.size) / 2)),
    contains=lambda shape, p: np.asarray((np.abs(p) <= np.array(shape.size) / 2).all(axis=1)),
    rays=lambda shape, p, d: [box_interval(np.array(shape.size) / 2, p, d)],
    triangles=lambda shape: box_triangles(shape.corners),
    mass=lambda shape, density: box_mass(shape.size, density),
    feature=lambda shape, x, n, tie, off: feature_of_box(np.array(shape.size), x, n, tie, off),
    scaled=lambda shape, factor: Box([factor * s for s in shape.size]),
    corners=lambda shape: shape.corners,
    farthest=lambda shape: np.array(shape.size),
    exact=True,
)
