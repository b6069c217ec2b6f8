"""The cone."""

from __future__ import annotations

from dataclasses import dataclass
from math import sqrt
from typing import Any, Final

import numpy as np

from collision_monitor._jit import inlined
from collision_monitor.geometry.vector import Vector
from collision_monitor.records import ShapeType
from collision_monitor.shapes.kind import Booleans, Kind, Row, fields_of, made_of
from collision_monitor.shapes.revolved import (
    feature_of_revolved,
    revolved_interval,
    revolved_mass,
    revolved_surface,
    support_of_revolved,
)
from collision_monitor.shapes.shape import Array, Shape, set_positive

CONE: Final = int(ShapeType.CONE)


@dataclass(frozen=True)
class Cone(Shape):
    """Cone; radius of the base and height (length) in m. The apex is at +length/2.

    >>> Cone(radius=0.2, length=1)
    Cone(radius=0.2, length=1.0)
    """

    radius: float
    length: float

    def __post_init__(self) -> None:
        set_positive(self, ["radius", "length"])


@inlined
def cone_support_point(radius: float, half: float, d: Vector) -> Vector:
    """Farthest point along d."""
    dx, dy, dz = d
    rim = sqrt(dx * dx + dy * dy)
    if dz * half >= radius * rim - dz * half:
        return 0.0, 0.0, half
    if rim > 0.0:
        return radius * dx / rim, radius * dy / rim, -half
    return 0.0, 0.0, -half


@inlined
def cone_support(radius: float, half: float, x: float, y: float, z: float) -> float:
    """Return max m . p over the points p of a cone by its base radius and half height (m), for m = (x, y, z)."""
    return max(z * half, radius * sqrt(x * x + y * y) - z * half)


def _contains(shape: Cone, p: Array) -> Booleans:
    rim = np.hypot(p[:, 0], p[:, 1])
    below = rim * shape.length <= shape.radius * (shape.length / 2 - p[:, 2])
    return np.asarray((np.abs(p[:, 2]) <= shape.length / 2) & below)


def _row(shape: Cone, _: Any) -> Row:
    size = shape.radius, shape.length / 2  # radius of the base, half height
    return Row(CONE, size, float(np.hypot(*size)))


KIND: Final = Kind(
    number=ShapeType.CONE,
    name="cone",
    shape=Cone,
    dimensions="radius, length",
    fields=fields_of("radius", "length"),
    make=made_of(Cone),
    row=_row,
    support=lambda shape, d: support_of_revolved(d, 0.0, shape.radius, shape.length),
    contains=_contains,
    rays=lambda shape, p, d: [revolved_interval(p, d, 0.0, shape.radius, shape.length)],
    triangles=lambda shape: revolved_surface(0.0, shape.radius, shape.length),
    mass=lambda shape, density: revolved_mass(0.0, shape.radius, shape.length, density),
    feature=lambda shape, x, n, tie, off: feature_of_revolved(x, n, 0.0, shape.radius, shape.length),
    scaled=lambda shape, factor: Cone(factor * shape.radius, factor * shape.length),
    curved=True,
    round=True,
    revolved=True,
    exact=True,
)
