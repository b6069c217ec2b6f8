"""The rounded box: a smaller box, grown by a radius. To the kernels it is a box with a margin."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product
from math import pi
from typing import Any, Final

import numpy as np

from collision_monitor.errors import ShapeError
from collision_monitor.geometry.contact_features import Feature
from collision_monitor.records import ShapeType
from collision_monitor.shapes.kind import Booleans, Fields, Kind, Row
from collision_monitor.shapes.kinds.box import BOX, box_interval, feature_of_box
from collision_monitor.shapes.kinds.sphere import SPHERE, unit_sphere_surface
from collision_monitor.shapes.mass import MassProperties
from collision_monitor.shapes.rays import RayInterval, ball_interval, common_interval, slab_interval, tube_interval
from collision_monitor.shapes.shape import Array, Shape, full_extents, positive
from collision_monitor.shapes.surface_parts import Triangles, hull_triangles


@dataclass(frozen=True)
class RoundedBox(Shape):
    """Box with rounded edges and corners; size: full extents (x, y, z) in m; radius of the rounding in m.

    The radius is at most half of the smallest extent.

    >>> RoundedBox((1, 2, 3), radius=0.1)
    RoundedBox(size=(1.0, 2.0, 3.0), radius=0.1)
    """

    size: Any
    radius: float

    def __post_init__(self) -> None:
        size = full_extents(self.size, "RoundedBox size", "RoundedBox((1, 1, 1), radius=0.1)")
        radius = positive(self.radius, "RoundedBox radius")
        if 2.0 * radius > min(size):
            most = f"half of the smallest extent ({min(size) / 2:g} m)"
            raise ShapeError(f"RoundedBox radius: expected at most {most}, got {radius:g} m")
        object.__setattr__(self, "size", size)
        object.__setattr__(self, "radius", radius)

    @property
    def core(self) -> Array:
        """Half extents (3,) of the box that is grown by the radius (m)."""
        return np.maximum(np.array(self.size) / 2 - self.radius, 0.0)


def _contains(shape: RoundedBox, p: Array) -> Booleans:
    return np.asarray(np.linalg.norm(np.maximum(np.abs(p) - shape.core, 0.0), axis=1) <= shape.radius)


def _rays(shape: RoundedBox, p: Array, d: Array) -> list[RayInterval]:
    """Three boxes that are longer along one axis, cylinders along the twelve edges, and balls at the corners."""
    core, r = shape.core, shape.radius
    parts = [box_interval(core + r * np.eye(3)[axis], p, d) for axis in range(3)]
    for axis in range(3):
        turn = np.roll(np.eye(3), -axis - 1, axis=0)  # to axes in which the edge is along z
        own_p, own_d = p @ turn.T, d @ turn.T
        for x, y in product((-1.0, 1.0), repeat=2):
            at = np.array([x, y, 0.0]) * (turn @ core)
            tube = common_interval(tube_interval(own_p - at, own_d, r), slab_interval(own_p, own_d, core[axis]))
            parts.append(tube._replace(normal=tube.normal @ turn))
    return parts + [ball_interval(p - np.array(side) * core, d, r) for side in product((-1.0, 1.0), repeat=3)]


def _triangles(shape: RoundedBox) -> Triangles:
    """Faces of the hull of an eighth of a sphere at each corner."""
    points = shape.radius * unit_sphere_surface().reshape(-1, 3)
    return hull_triangles(np.unique(points + np.where(points < 0.0, -shape.core, shape.core), axis=0))


def _mass(shape: RoundedBox, density: float) -> MassProperties:
    """Sums over the parts: the core, slabs on its faces, quarter cylinders on its edges, eighths of balls.

    By symmetry only the mean squares of x, y and z are needed.
    """
    a, r = shape.core, shape.radius
    volume, squares = 8.0 * float(np.prod(a)), 8.0 * float(np.prod(a)) * a**2 / 3.0
    for i, j, k in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
        slab = 8.0 * a[j] * a[k] * r  # both slabs across i
        volume += slab
        squares[i] += slab * ((a[i] + r / 2.0) ** 2 + r * r / 12.0)
        squares[[j, k]] += slab * a[[j, k]] ** 2 / 3.0
        edge = 2.0 * pi * r * r * a[i]  # the four edges along i; a quarter disc's centre is 4 r / 3 pi off, its mean
        offset, mean_square = 4.0 * r / (3.0 * pi), r * r / 4.0  # square along each axis is r² / 4
        volume += edge
        squares[i] += edge * a[i] ** 2 / 3.0
        squares[[j, k]] += edge * (a[[j, k]] ** 2 + 2.0 * a[[j, k]] * offset + mean_square)
    ball = 4.0 / 3.0 * pi * r**3  # eighths of a ball: centre 3 r / 8 off, mean square r² / 5
    volume += ball
    squares += ball * (a**2 + 2.0 * a * 0.375 * r + r * r / 5.0)
    return MassProperties(density * volume, np.zeros(3), density * np.diag(squares.sum() - squares))


def _row(shape: RoundedBox, _: Any) -> Row:
    core, r = shape.core, shape.radius
    if not core.any():
        return Row(SPHERE, (r,), r)
    return Row(BOX, tuple(core.tolist()), float(np.linalg.norm(core)), margin=r)


def _support(shape: RoundedBox, d: Array) -> Array:
    return np.asarray(np.abs(d) @ shape.core + shape.radius)


def _feature(shape: RoundedBox, point: Array, normal: Array, tie: float, off: float) -> Feature:
    return feature_of_box(2.0 * shape.core, point - shape.radius * normal, normal, tie, off)


def _make(fields: Fields) -> RoundedBox:
    return RoundedBox(fields.dimensions[:3], fields.dimensions[3])


KIND: Final = Kind(
    number=ShapeType.ROUNDED_BOX,
    name="rounded box",
    shape=RoundedBox,
    dimensions="x, y, z, radius",
    fields=lambda shape: Fields((*shape.size, shape.radius)),
    make=_make,
    row=_row,
    support=_support,
    contains=_contains,
    rays=_rays,
    triangles=_triangles,
    mass=_mass,
    feature=_feature,
    scaled=lambda shape, factor: RoundedBox([factor * s for s in shape.size], factor * shape.radius),
    farthest=lambda shape: shape.core if shape.core.any() else np.array([0.0, 0.0, 1.0]),
    round=True,
)
