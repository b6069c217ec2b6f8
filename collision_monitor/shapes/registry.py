"""The registry of the kinds of shapes: all of them, by number and by class, and what kernels ask of a kind's number."""

from __future__ import annotations

from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from collision_monitor.errors import ShapeError
from collision_monitor.shapes.kind import Kind
from collision_monitor.shapes.kinds import (
    box,
    capsule,
    circle,
    cone,
    convex_hull,
    cylinder,
    ellipsoid,
    grid,
    half_space,
    height_field,
    mesh,
    points,
    polygon,
    rounded_box,
    sphere,
    truncated_cone,
    voxels,
)
from collision_monitor.shapes.kinds.box import Box as Box
from collision_monitor.shapes.kinds.capsule import Capsule as Capsule
from collision_monitor.shapes.kinds.circle import Circle as Circle
from collision_monitor.shapes.kinds.cone import Cone as Cone
from collision_monitor.shapes.kinds.convex_hull import ConvexHull as ConvexHull
from collision_monitor.shapes.kinds.convex_hull import Triangle as Triangle
from collision_monitor.shapes.kinds.cylinder import Cylinder as Cylinder
from collision_monitor.shapes.kinds.ellipsoid import Ellipsoid as Ellipsoid
from collision_monitor.shapes.kinds.grid import Grid as Grid
from collision_monitor.shapes.kinds.half_space import HalfSpace as HalfSpace
from collision_monitor.shapes.kinds.height_field import HeightField as HeightField
from collision_monitor.shapes.kinds.mesh import Mesh as Mesh
from collision_monitor.shapes.kinds.points import Points as Points
from collision_monitor.shapes.kinds.polygon import Polygon as Polygon
from collision_monitor.shapes.kinds.rounded_box import RoundedBox as RoundedBox
from collision_monitor.shapes.kinds.sphere import Sphere as Sphere
from collision_monitor.shapes.kinds.truncated_cone import TruncatedCone as TruncatedCone
from collision_monitor.shapes.kinds.voxels import Voxels as Voxels
from collision_monitor.shapes.shape import Shape as Shape

__all__ = [
    "Box", "Capsule", "Circle", "Cone", "ConvexHull", "Cylinder", "Ellipsoid", "Grid", "HalfSpace", "HeightField",
    "Mesh", "Points", "Polygon", "RoundedBox", "Sphere", "TruncatedCone", "Voxels",
]  # fmt: skip
"""The public classes, for type checkers of `collision_monitor`."""

KINDS: Final[tuple[Kind, ...]] = tuple(
    each.KIND
    for each in (
        sphere, box, capsule, cylinder, cone, convex_hull, mesh, half_space, circle, polygon, ellipsoid, points,
        rounded_box, truncated_cone, grid, voxels, height_field,
    )
)  # fmt: skip
"""Every kind that a message may hold, in the order of its numbers."""

_BY_NUMBER: Final = {int(kind.number): kind for kind in KINDS}
_BY_CLASS: Final = {kind.shape: kind for kind in (*KINDS, convex_hull.TRIANGLE)}


def kind_of(shape: Any) -> Kind:
    """Return the kind of a shape. Raises ShapeError for any other object."""
    for each in type(shape).__mro__:
        if each in _BY_CLASS:
            return _BY_CLASS[each]
    names = ", ".join(kind.shape.__name__ for kind in KINDS)
    raise ShapeError(f"expected a shape ({names}), got {type(shape).__name__}")


def kind_with(number: int) -> Kind | None:
    """Return the kind with a number of `ShapeType`, or None."""
    return _BY_NUMBER.get(int(number))


def _array(name: str) -> NDArray[np.bool_]:
    """Whether each number of kind has this property."""
    found = np.zeros(1 + max(_BY_NUMBER), np.bool_)
    for number, kind in _BY_NUMBER.items():
        found[number] = getattr(kind, name)
    return found


# Frozen arrays by number, which kernels read as constants.
CURVED: Final = _array("curved")
REVOLVED: Final = _array("revolved")
BALL: Final = _array("ball")

KIND_NAMES: Final = {int(kind.number): kind.name for kind in KINDS}
"""Names for texts, such as those of a scene plan."""

_SLOTS: Final = [kind for kind in KINDS if not issubclass(kind.shape, Mesh | Points)]

SUPPORTED_SHAPES: Final = ", ".join(
    [kind.shape.__name__ for kind in _SLOTS if not kind.planar]
    + [f"{kind.shape.__name__} (in the plane)" for kind in _SLOTS if kind.planar]
)
"""Shapes that a slot of the table represents by numbers and vertices."""
