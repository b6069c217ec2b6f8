"""The half-space."""

from __future__ import annotations

from dataclasses import dataclass
from math import inf
from typing import Any, Final

import numpy as np

from collision_monitor.checks.numbers import real_array, real_number
from collision_monitor.errors import ShapeError
from collision_monitor.geometry.contact_features import Feature, FeatureType
from collision_monitor.records import ShapeType
from collision_monitor.shapes.kind import Fields, Kind, Row
from collision_monitor.shapes.rays import planes_interval
from collision_monitor.shapes.shape import Array, Shape
from collision_monitor.shapes.surface_parts import plane_triangles
from collision_monitor.tolerances import HULL_DROP, LARGEST_INPUT

HALF_SPACE: Final = int(ShapeType.HALF_SPACE)


@dataclass(frozen=True, eq=False)
class HalfSpace(Shape):
    """Half-space {x : normal . x <= offset}, offset in m. The normal points out of the solid; both get normalised.

    >>> HalfSpace(normal=(0, 0, 2), offset=1).normal  # the floor z <= 0.5
    array([0., 0., 1.])
    """

    normal: Any
    offset: float = 0.0

    def __post_init__(self) -> None:
        try:
            normal = np.array(real_array(self.normal))
            offset = real_number(self.offset)
        except (TypeError, ValueError, OverflowError):
            got = f"{self.normal!r}, {self.offset!r}"
            raise ShapeError(f"HalfSpace: expected a normal (3) and an offset, got {got}") from None
        with np.errstate(over="ignore"):  # an infinite length is refused below
            length = float(np.linalg.norm(normal)) if normal.shape == (3,) else 0.0
        if not (length > 0.0 and np.isfinite(length) and np.isfinite(offset)):
            raise ShapeError(
                f"HalfSpace: expected a non-zero, finite normal and a finite offset, got {self.normal}, {offset}"
            )
        normal, offset = normal / length, offset / length
        if not abs(offset) <= LARGEST_INPUT:
            raise ShapeError(f"HalfSpace offset: expected at most {LARGEST_INPUT:g} m, got {offset:g} m")
        normal.setflags(write=False)
        object.__setattr__(self, "normal", normal)
        object.__setattr__(self, "offset", offset)


def _make(fields: Fields) -> HalfSpace:
    return HalfSpace(fields.dimensions[:3], fields.dimensions[3])


def _support(shape: HalfSpace, d: Array) -> Array:
    return np.where(d @ shape.normal >= 1.0 - HULL_DROP, shape.offset, np.inf)


KIND: Final = Kind(
    number=ShapeType.HALF_SPACE,
    name="half-space",
    shape=HalfSpace,
    dimensions="nx, ny, nz, offset",
    fields=lambda shape: Fields((*shape.normal, shape.offset)),
    make=_make,
    row=lambda shape, _: Row(HALF_SPACE, (*shape.normal, shape.offset), inf),  # size: normal, offset
    support=_support,
    contains=lambda shape, p: p @ shape.normal <= shape.offset,
    rays=lambda shape, p, d: [planes_interval(shape.normal[None], np.array([shape.offset]), p, d)],
    triangles=lambda shape: plane_triangles(np.asarray(shape.normal), shape.offset),
    feature=lambda shape, x, n, tie, off: Feature(FeatureType.FACE, (), 0),
    middle=lambda shape: np.asarray(shape.offset * shape.normal),
    scaled=lambda shape, factor: HalfSpace(shape.normal, factor * shape.offset),
    bounded=False,
)
