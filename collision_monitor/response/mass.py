"""Mass, centre of mass and inertia of solid shapes of constant density."""

from __future__ import annotations

from math import pi
from typing import NamedTuple

import numpy as np

from collision_monitor.errors import InputError, UnsupportedError
from collision_monitor.geometry.bounding_volumes import convex_hull
from collision_monitor.geometry.coordinates import Array, Indices
from collision_monitor.geometry.polyhedra import is_closed
from collision_monitor.shapes.shapes import Box, Capsule, Cone, ConvexHull, Cylinder, Mesh, Shape, Sphere


class MassProperties(NamedTuple):
    """mass (kg), centre of mass (3,) in m, and inertia (3, 3) about that centre in kg m², in the shape's frame."""

    mass: float
    centre: Array
    inertia: Array


def mass_properties(shape: Shape, density: float = 1000.0) -> MassProperties:
    """Mass properties of a solid of this density (kg/m³); closed forms, or the tetrahedra of a closed surface.

    Raises InputError for a density that is not positive, UnsupportedError for a shape without a volume.
    """
    if not (np.isfinite(density) and density > 0.0):
        raise InputError(f"density: expected a positive number of kg/m³, got {density!r}")
    match shape:
        case Sphere():
            mass = density * 4 / 3 * pi * shape.radius**3
            return MassProperties(mass, np.zeros(3), 0.4 * mass * shape.radius**2 * np.eye(3))
        case Box() if min(shape.size) > 0.0:
            mass, squares = density * float(np.prod(shape.size)), np.square(shape.size)
            return MassProperties(mass, np.zeros(3), np.diag(mass / 12 * (squares.sum() - squares)))
        case Cylinder():
            mass = density * pi * shape.radius**2 * shape.length
            across = mass * (3 * shape.radius**2 + shape.length**2) / 12
            return MassProperties(mass, np.zeros(3), np.diag([across, across, mass * shape.radius**2 / 2]))
        case Cone():  # the centre lies a quarter of the height above the base
            r, h = shape.radius, shape.length
            mass = density * pi * r**2 * h / 3
            across = mass * (3 / 20 * r**2 + 3 / 80 * h**2)
            return MassProperties(mass, np.array([0, 0, -h / 4]), np.diag([across, across, 0.3 * mass * r**2]))
        case Capsule():
            return _capsule(shape.radius, shape.length, density)
        case ConvexHull():
            return _polyhedron(*convex_hull(shape.points), density)
        case Mesh() if is_closed(shape.faces):
            return _polyhedron(shape.vertices, shape.faces.astype(np.int64), density)
    raise UnsupportedError(
        f"{type(shape).__name__} has no mass properties; supported are Sphere, Box with a volume, Capsule, Cylinder, "
        "Cone, ConvexHull, closed Mesh"
    )


def _capsule(r: float, length: float, density: float) -> MassProperties:
    """A cylinder with two half balls, whose centres of mass are 3/8 r beyond its ends."""
    core, ball = density * pi * r**2 * length, density * 4 / 3 * pi * r**3
    across = core * (3 * r**2 + length**2) / 12 + ball * (0.4 * r**2 + length**2 / 4 + 3 / 8 * r * length)
    return MassProperties(core + ball, np.zeros(3), np.diag([across, across, (core / 2 + 0.4 * ball) * r**2]))


def _polyhedron(vertices: Array, faces: Indices, density: float) -> MassProperties:
    """Sum of the tetrahedra from one point to each face (Blow and Binstock, 2004)."""
    origin = vertices.mean(axis=0)  # far from the origin the products would cancel
    corners = (vertices - origin)[faces]
    volume = np.linalg.det(corners) / 6
    total = float(volume.sum())
    if not total > 0.0:
        raise UnsupportedError("Mesh: expected faces that enclose a volume, counter-clockwise from outside")
    sums = corners.sum(axis=1)
    centre = (volume[:, None] * sums).sum(axis=0) / (4 * total)
    second = np.einsum("n,nki,nkj->ij", volume, corners, corners) + np.einsum("n,ni,nj->ij", volume, sums, sums)
    second = second / 20 - total * np.outer(centre, centre)
    inertia = density * (np.trace(second) * np.eye(3) - second)
    return MassProperties(density * total, origin + centre, inertia)
