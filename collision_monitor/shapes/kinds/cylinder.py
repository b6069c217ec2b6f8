"""The cylinder."""

from __future__ import annotations

from dataclasses import dataclass
from math import copysign, sqrt
from typing import Any, Final

import numpy as np

from collision_monitor._jit import device, inlined
from collision_monitor.geometry.vector import Vector
from collision_monitor.records import ShapeType
from collision_monitor.shapes.kind import Booleans, Kind, Row, fields_of, made_of
from collision_monitor.shapes.rays import common_interval, slab_interval, tube_interval
from collision_monitor.shapes.revolved import feature_of_revolved, revolved_mass, revolved_surface
from collision_monitor.shapes.shape import Array, Shape, set_positive

CYLINDER: Final = int(ShapeType.CYLINDER)


@dataclass(frozen=True)
class Cylinder(Shape):
    """Cylinder; radius and height (length) in m.

    >>> Cylinder(radius=0.2, length=1)
    Cylinder(radius=0.2, length=1.0)
    """

    radius: float
    length: float

    def __post_init__(self) -> None:
        set_positive(self, ["radius", "length"])


@inlined
def cylinder_support_point(radius: float, half: float, d: Vector) -> Vector:
    """Farthest point along d."""
    dx, dy, dz = d
    rim = sqrt(dx * dx + dy * dy)
    z = copysign(half, dz)
    if rim > 0.0:
        return radius * dx / rim, radius * dy / rim, z
    return 0.0, 0.0, z


@inlined
def cylinder_support(radius: float, half: float, x: float, y: float, z: float) -> float:
    """Return max m . p over the points p of a cylinder by its radius and half height (m), for m = (x, y, z)."""
    return abs(z) * half + radius * sqrt(x * x + y * y)


@device
def cylinder_distance(radius: float, half: float, x: Vector) -> tuple[float, Vector]:
    """Signed distance (m) of a point from a cylinder by its radius and half height (m), and its direction."""
    rim = sqrt(x[0] * x[0] + x[1] * x[1])
    side, end = rim - radius, abs(x[2]) - half
    up = -1.0 if x[2] < 0.0 else 1.0
    out = (x[0] / rim, x[1] / rim, 0.0) if rim > 0.0 else (1.0, 0.0, 0.0)
    if side > 0.0 and end > 0.0:
        length = sqrt(side * side + end * end)
        return length, (out[0] * side / length, out[1] * side / length, up * end / length)
    if side > end:
        return side, out
    return end, (0.0, 0.0, up)


def _contains(shape: Cylinder, p: Array) -> Booleans:
    return np.asarray((np.hypot(p[:, 0], p[:, 1]) <= shape.radius) & (np.abs(p[:, 2]) <= shape.length / 2))


def _support(shape: Cylinder, d: Array) -> Array:
    return np.asarray(np.abs(d[..., 2]) * shape.length / 2 + shape.radius * np.hypot(d[..., 0], d[..., 1]))


def _row(shape: Cylinder, _: Any) -> Row:
    size = shape.radius, shape.length / 2  # radius, half height
    return Row(CYLINDER, size, float(np.hypot(*size)))


KIND: Final = Kind(
    number=ShapeType.CYLINDER,
    name="cylinder",
    shape=Cylinder,
    dimensions="radius, length",
    fields=fields_of("radius", "length"),
    make=made_of(Cylinder),
    row=_row,
    support=_support,
    contains=_contains,
    rays=lambda shape, p, d: [
        common_interval(tube_interval(p, d, shape.radius), slab_interval(p, d, shape.length / 2))
    ],
    triangles=lambda shape: revolved_surface(shape.radius, shape.radius, shape.length),
    mass=lambda shape, density: revolved_mass(shape.radius, shape.radius, shape.length, density),
    feature=lambda shape, x, n, tie, off: feature_of_revolved(x, n, shape.radius, shape.radius, shape.length),
    scaled=lambda shape, factor: Cylinder(factor * shape.radius, factor * shape.length),
    farthest=lambda shape: np.array([shape.radius, 0.0, shape.length / 2]),
    curved=True,
    round=True,
    revolved=True,
    exact=True,
)
