"""The ellipsoid."""

from __future__ import annotations

from dataclasses import dataclass
from math import inf, pi, sqrt
from typing import Any, Final

import numpy as np

from collision_monitor._jit import device, inlined
from collision_monitor.errors import ShapeError
from collision_monitor.geometry.vector import Vector, dot
from collision_monitor.records import ShapeType
from collision_monitor.shapes.kind import Booleans, Fields, Kind, Row
from collision_monitor.shapes.kinds.sphere import SPHERE, unit_sphere_surface
from collision_monitor.shapes.mass import MassProperties
from collision_monitor.shapes.rays import RayInterval, row_dot
from collision_monitor.shapes.shape import Array, Shape, positive

ELLIPSOID: Final = int(ShapeType.ELLIPSOID)


@dataclass(frozen=True)
class Ellipsoid(Shape):
    """Ellipsoid; radii: half axes along x, y, z in m.

    >>> Ellipsoid((0.3, 0.2, 0.1))
    Ellipsoid(radii=(0.3, 0.2, 0.1))
    """

    radii: Any

    def __post_init__(self) -> None:
        try:
            radii = tuple(self.radii)
        except TypeError:
            raise ShapeError(f"Ellipsoid radii: expected 3 half axes in metres, got {self.radii!r}") from None
        if len(radii) != 3:
            raise ShapeError(f"Ellipsoid radii: expected 3 half axes in metres, got {self.radii!r}")
        object.__setattr__(self, "radii", tuple(positive(radius, "Ellipsoid radii") for radius in radii))


@inlined
def ellipsoid_support_point(e: Vector, d: Vector) -> Vector:
    """Farthest point along d."""
    x, y, z = e[0] * d[0], e[1] * d[1], e[2] * d[2]
    length = sqrt(x * x + y * y + z * z)
    if length > 0.0:
        return e[0] * (x / length), e[1] * (y / length), e[2] * (z / length)
    return 0.0, 0.0, e[2]


@inlined
def ellipsoid_support(e: Vector, x: float, y: float, z: float) -> float:
    """Return max m . p over the points p of an ellipsoid by its half axes (m), for m = (x, y, z) of any length."""
    u, v, w = x * e[0], y * e[1], z * e[2]
    return sqrt(u * u + v * v + w * w)


@device
def ellipsoid_distance(e: Vector, x: Vector) -> tuple[float, float, Vector]:
    """Bounds (m) on the signed distance of a point, and the direction n that gives the lower one, n . x - h(n).

    The upper one is the distance along the ray from the centre, or a ball about a point inside.
    """
    f = sqrt((x[0] / e[0]) ** 2 + (x[1] / e[1]) ** 2 + (x[2] / e[2]) ** 2)
    least = min(e[0], e[1], e[2])
    w = x[0] / (e[0] * e[0]), x[1] / (e[1] * e[1]), x[2] / (e[2] * e[2])
    steep = sqrt(dot(w, w))
    lower, n = -inf, (1.0, 0.0, 0.0)
    if steep > 0.0:  # the normal of the similar ellipsoid through the point
        n = w[0] / steep, w[1] / steep, w[2] / steep
        h = sqrt((e[0] * n[0]) ** 2 + (e[1] * n[1]) ** 2 + (e[2] * n[2]) ** 2)
        lower = dot(n, x) - h
    if f < 1.0:
        for k in range(3):
            out = abs(x[k]) - e[k]
            if out > lower:
                side = -1.0 if x[k] < 0.0 else 1.0
                lower = out
                n = (side if k == 0 else 0.0, side if k == 1 else 0.0, side if k == 2 else 0.0)
        return lower, (f - 1.0) * least, n
    away = sqrt(dot(x, x))
    u = x[0] / away, x[1] / away, x[2] / away
    radial = away - ellipsoid_support(e, u[0], u[1], u[2])  # the better bound far away
    if radial > lower:
        lower, n = radial, u
    return lower, away * (1.0 - 1.0 / f), n


def _contains(shape: Ellipsoid, p: Array) -> Booleans:
    with np.errstate(over="ignore"):  # a point that is far from a small ellipsoid
        return np.asarray(np.linalg.norm(p / shape.radii, axis=1) <= 1.0)


def _rays(shape: Ellipsoid, p: Array, d: Array) -> list[RayInterval]:
    """In coordinates in which it is a ball, and from the ray's point nearest to its centre, which keeps digits."""
    radii = np.array(shape.radii)
    near = -row_dot(p, d)
    least = radii.min()
    w, u = (p + near[:, None] * d) * (least / radii), d * (least / radii)
    square = row_dot(u, u)
    middle = -row_dot(w, u) / square
    across = w + middle[:, None] * u
    rest = least * least - row_dot(across, across)
    half = np.sqrt(np.maximum(rest, 0.0) / square)
    normal = (across - half[:, None] * u) * (least / radii)
    length = np.linalg.norm(normal, axis=1, keepdims=True)
    enter = np.where(rest >= 0.0, near + middle - half, np.inf)
    leave = np.where(rest >= 0.0, near + middle + half, -np.inf)
    return [RayInterval(enter, leave, normal / np.where(length > 0.0, length, 1.0))]


def _mass(shape: Ellipsoid, density: float) -> MassProperties:
    mass, squares = density * 4 / 3 * pi * float(np.prod(shape.radii)), np.square(shape.radii)
    return MassProperties(mass, np.zeros(3), np.diag(mass / 5 * (squares.sum() - squares)))


def _row(shape: Ellipsoid, _: Any) -> Row:
    if len(set(shape.radii)) == 1:
        return Row(SPHERE, shape.radii[:1], shape.radii[0])  # which has closed forms
    return Row(ELLIPSOID, shape.radii, max(shape.radii))  # size: half axes


KIND: Final = Kind(
    number=ShapeType.ELLIPSOID,
    name="ellipsoid",
    shape=Ellipsoid,
    dimensions="rx, ry, rz",
    fields=lambda shape: Fields(tuple(shape.radii)),
    make=lambda fields: Ellipsoid(fields.dimensions),
    row=_row,
    support=lambda shape, d: np.asarray(np.linalg.norm(d * shape.radii, axis=-1)),
    contains=_contains,
    rays=_rays,
    triangles=lambda shape: np.asarray(unit_sphere_surface() * shape.radii),
    mass=_mass,
    scaled=lambda shape, factor: Ellipsoid([factor * radius for radius in shape.radii]),
    farthest=lambda shape: np.eye(3)[int(np.argmax(shape.radii))],
    curved=True,
    round=True,
)
