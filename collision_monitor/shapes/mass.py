"""Mass, centre of mass and inertia of solids of constant density: what the kinds of shapes share."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from collision_monitor.errors import UnsupportedError
from collision_monitor.geometry.coordinates import Array, Indices


class MassProperties(NamedTuple):
    """mass (kg), centre of mass (3,) in m, and inertia (3, 3) about that centre in kg m², in the shape's frame."""

    mass: float
    centre: Array
    inertia: Array


def polyhedron_mass(vertices: Array, faces: Indices, density: float) -> MassProperties:
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


def moved(parts: list[tuple[MassProperties, Array]]) -> MassProperties:
    """Mass properties of a body made of parts, each moved by a vector (3,) in m (parallel axis theorem)."""
    mass = sum(part.mass for part, _ in parts)
    centres = np.array([part.centre + by for part, by in parts])
    centre = np.array([part.mass for part, _ in parts]) @ centres / mass
    inertia = np.zeros((3, 3))
    for (part, _), at in zip(parts, centres - centre, strict=True):
        inertia += part.inertia + part.mass * (at @ at * np.eye(3) - np.outer(at, at))
    return MassProperties(mass, centre, inertia)
