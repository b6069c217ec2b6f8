"""The sphere."""

from __future__ import annotations

from dataclasses import dataclass
from math import pi, sqrt
from typing import Final

import numpy as np

from collision_monitor._jit import inlined
from collision_monitor.geometry.vector import Vector, dot
from collision_monitor.records import ShapeType
from collision_monitor.shapes.kind import Kind, Row, fields_of, made_of
from collision_monitor.shapes.mass import MassProperties
from collision_monitor.shapes.rays import ball_interval
from collision_monitor.shapes.shape import Array, Shape, set_positive
from collision_monitor.shapes.surface_parts import SIDES, Triangles, revolved_triangles

SPHERE: Final = int(ShapeType.SPHERE)


@dataclass(frozen=True)
class Sphere(Shape):
    """Sphere; radius in m.

    >>> Sphere(0.5)
    Sphere(radius=0.5)
    """

    radius: float

    def __post_init__(self) -> None:
        set_positive(self, ["radius"])


@inlined
def distance_from_centre(x: Vector, radius: float) -> tuple[float, Vector]:
    """Signed distance (m) of a point from a ball about the origin, and its direction out of the ball."""
    length = sqrt(dot(x, x))
    n = (x[0] / length, x[1] / length, x[2] / length) if length > 0.0 else (1.0, 0.0, 0.0)
    return length - radius, n


def unit_sphere_surface() -> Triangles:
    """Coarse triangles of the sphere with the radius 1."""
    angles = np.linspace(-np.pi / 2, np.pi / 2, SIDES // 2 + 1)
    return revolved_triangles(np.cos(angles), np.sin(angles))


def _mass(shape: Sphere, density: float) -> MassProperties:
    mass = density * 4 / 3 * pi * shape.radius**3
    return MassProperties(mass, np.zeros(3), 0.4 * mass * shape.radius**2 * np.eye(3))


def _support(shape: Sphere, d: Array) -> Array:
    return np.full(d.shape[:-1], shape.radius)


KIND: Final = Kind(
    number=ShapeType.SPHERE,
    name="sphere",
    shape=Sphere,
    dimensions="radius",
    fields=fields_of("radius"),
    make=made_of(Sphere),
    row=lambda shape, _: Row(SPHERE, (shape.radius,), shape.radius),  # size: radius; the core is a point
    support=_support,
    contains=lambda shape, p: np.linalg.norm(p, axis=1) <= shape.radius,
    rays=lambda shape, p, d: [ball_interval(p, d, shape.radius)],
    triangles=lambda shape: shape.radius * unit_sphere_surface(),
    mass=_mass,
    scaled=lambda shape, factor: Sphere(factor * shape.radius),
    farthest=lambda shape: np.array([0.0, 0.0, 1.0]),
    round=True,
    revolved=True,
    ball=True,
)
