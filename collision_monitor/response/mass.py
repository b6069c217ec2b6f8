"""Mass, centre of mass and inertia of solid shapes of constant density; each kind of shape says how."""

from __future__ import annotations

import numpy as np

from collision_monitor.errors import InputError, UnsupportedError
from collision_monitor.shapes.mass import MassProperties as MassProperties
from collision_monitor.shapes.registry import KINDS, Shape, kind_of


def mass_properties(shape: Shape, density: float = 1000.0) -> MassProperties:
    """Mass properties of a solid of this density (kg/m³); closed forms, or the tetrahedra of a closed surface.

    Raises InputError for a density that is not positive, UnsupportedError for a shape without a volume.
    """
    if not (np.isfinite(density) and density > 0.0):
        raise InputError(f"density: expected a positive number of kg/m³, got {density!r}")
    mass = kind_of(shape).mass
    found = None if mass is None else mass(shape, density)
    if found is None:
        solids = ", ".join(kind.shape.__name__ for kind in KINDS if kind.mass is not None)
        raise UnsupportedError(f"{type(shape).__name__} has no mass properties; supported are {solids}, with a volume")
    return found
