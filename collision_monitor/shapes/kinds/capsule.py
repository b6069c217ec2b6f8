"""The capsule."""

from __future__ import annotations

from dataclasses import dataclass
from math import pi
from typing import Any, Final

import numpy as np

from collision_monitor._jit import inlined
from collision_monitor.geometry.contact_features import Feature
from collision_monitor.geometry.round_features import feature_of_outline
from collision_monitor.geometry.vector import Vector
from collision_monitor.records import ShapeType
from collision_monitor.shapes.kind import Booleans, Kind, Row, fields_of, made_of
from collision_monitor.shapes.kinds.sphere import distance_from_centre
from collision_monitor.shapes.mass import MassProperties
from collision_monitor.shapes.rays import RayInterval, ball_interval, common_interval, slab_interval, tube_interval
from collision_monitor.shapes.shape import Array, Shape, set_positive
from collision_monitor.shapes.surface_parts import SIDES, Triangles, revolved_triangles

CAPSULE: Final = int(ShapeType.CAPSULE)


@dataclass(frozen=True)
class Capsule(Shape):
    """Capsule; radius and length of the core segment (without the caps) in m.

    >>> Capsule(radius=0.2, length=1)  # 1.4 m from end to end
    Capsule(radius=0.2, length=1.0)
    """

    radius: float
    length: float

    def __post_init__(self) -> None:
        set_positive(self, ["radius", "length"])


@inlined
def capsule_distance(radius: float, half: float, x: Vector) -> tuple[float, Vector]:
    """Signed distance (m) of a point from a capsule by its radius and half length (m), and its direction."""
    return distance_from_centre((x[0], x[1], x[2] - min(max(x[2], -half), half)), radius)


def _contains(shape: Capsule, p: Array) -> Booleans:
    beyond = np.maximum(np.abs(p[:, 2]) - shape.length / 2, 0.0)
    return np.asarray(np.hypot(np.hypot(p[:, 0], p[:, 1]), beyond) <= shape.radius)


def _rays(shape: Capsule, p: Array, d: Array) -> list[RayInterval]:
    end = np.array([0.0, 0.0, shape.length / 2])
    tube = common_interval(tube_interval(p, d, shape.radius), slab_interval(p, d, shape.length / 2))
    return [tube, ball_interval(p - end, d, shape.radius), ball_interval(p + end, d, shape.radius)]


def _triangles(shape: Capsule) -> Triangles:
    angles = np.linspace(0.0, np.pi / 2, SIDES // 4 + 1)
    radii, heights = shape.radius * np.cos(angles), shape.radius * np.sin(angles) + shape.length / 2
    return revolved_triangles(np.r_[radii[::-1], radii], np.r_[-heights[::-1], heights])


def _mass(shape: Capsule, density: float) -> MassProperties:
    """A cylinder with two half balls, whose centres of mass are 3/8 r beyond its ends."""
    r, length = shape.radius, shape.length
    core, ball = density * pi * r**2 * length, density * 4 / 3 * pi * r**3
    across = core * (3 * r**2 + length**2) / 12 + ball * (0.4 * r**2 + length**2 / 4 + 3 / 8 * r * length)
    return MassProperties(core + ball, np.zeros(3), np.diag([across, across, (core / 2 + 0.4 * ball) * r**2]))


def _feature(shape: Capsule, point: Array, normal: Array, tie: float, off: float) -> Feature:
    """Corner 0 (-z) or 1 (+z) of the core, or the edge between them."""
    ends = np.array([[0.0, 0.0, -0.5], [0.0, 0.0, 0.5]]) * shape.length
    return feature_of_outline(point - shape.radius * normal, normal, ends)


def _row(shape: Capsule, _: Any) -> Row:
    return Row(CAPSULE, (shape.radius, shape.length / 2), shape.radius + shape.length / 2)  # size: radius, half length


KIND: Final = Kind(
    number=ShapeType.CAPSULE,
    name="capsule",
    shape=Capsule,
    dimensions="radius, length",
    fields=fields_of("radius", "length"),
    make=made_of(Capsule),
    row=_row,
    support=lambda shape, d: np.asarray(np.abs(d[..., 2]) * shape.length / 2 + shape.radius),
    contains=_contains,
    rays=_rays,
    triangles=_triangles,
    mass=_mass,
    feature=_feature,
    scaled=lambda shape, factor: Capsule(factor * shape.radius, factor * shape.length),
    farthest=lambda shape: np.array([0.0, 0.0, 1.0]),
    round=True,
    revolved=True,
    exact=True,
)
