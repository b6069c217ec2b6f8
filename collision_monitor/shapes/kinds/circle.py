"""The circle, in the x-y plane."""

from __future__ import annotations

from dataclasses import dataclass
from math import sqrt
from typing import Final

import numpy as np

from collision_monitor._jit import inlined
from collision_monitor.geometry.vector import Vector
from collision_monitor.records import ShapeType
from collision_monitor.shapes.kind import Kind, Row, fields_of, made_of
from collision_monitor.shapes.rays import RayInterval, ball_interval, check_direction_in_plane
from collision_monitor.shapes.shape import Array, Shape, set_positive
from collision_monitor.shapes.surface_parts import revolved_triangles

CIRCLE: Final = int(ShapeType.CIRCLE)


@dataclass(frozen=True)
class Circle(Shape):
    """Circle in the x-y plane; radius in m.

    >>> Circle(0.5)
    Circle(radius=0.5)
    """

    radius: float

    def __post_init__(self) -> None:
        set_positive(self, ["radius"])


@inlined
def circle_support_point(radius: float, d: Vector) -> Vector:
    """Farthest point along d."""
    rim = sqrt(d[0] * d[0] + d[1] * d[1])
    if rim > 0.0:
        return radius * d[0] / rim, radius * d[1] / rim, 0.0
    return 0.0, 0.0, 0.0


@inlined
def circle_support(radius: float, x: float, y: float) -> float:
    """Return max m . p over the points p of a circle, for m = (x, y, z) of any length."""
    return radius * sqrt(x * x + y * y)


def _rays(shape: Circle, p: Array, d: Array) -> list[RayInterval]:
    check_direction_in_plane(d)
    return [ball_interval(p * [1.0, 1.0, 0.0], d, shape.radius)]


KIND: Final = Kind(
    number=ShapeType.CIRCLE,
    name="circle",
    shape=Circle,
    dimensions="radius",
    fields=fields_of("radius"),
    make=made_of(Circle),
    row=lambda shape, _: Row(CIRCLE, (shape.radius,), shape.radius),  # size: radius
    support=lambda shape, d: np.asarray(shape.radius * np.hypot(d[..., 0], d[..., 1])),
    contains=lambda shape, p: np.hypot(p[:, 0], p[:, 1]) <= shape.radius,
    rays=_rays,
    triangles=lambda shape: revolved_triangles(np.array([0.0, shape.radius]), np.zeros(2)),
    ball=True,
    planar=True,
)
