"""The truncated cone."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Final

import numpy as np

from collision_monitor.records import ShapeType
from collision_monitor.shapes.kind import Booleans, Kind, Row, fields_of, made_of
from collision_monitor.shapes.kinds.cylinder import CYLINDER
from collision_monitor.shapes.revolved import (
    feature_of_revolved,
    revolved_interval,
    revolved_mass,
    revolved_surface,
    support_of_revolved,
)
from collision_monitor.shapes.shape import Array, Shape, set_positive

TRUNCATED_CONE: Final = int(ShapeType.TRUNCATED_CONE)


@dataclass(frozen=True)
class TruncatedCone(Shape):
    """Cone without its tip: radii of the discs at -length/2 and at +length/2, and height (length), in m.

    >>> TruncatedCone(bottom_radius=0.3, top_radius=0.1, length=1)
    TruncatedCone(bottom_radius=0.3, top_radius=0.1, length=1.0)
    """

    bottom_radius: float
    top_radius: float
    length: float

    def __post_init__(self) -> None:
        set_positive(self, ["bottom_radius", "top_radius", "length"])

    @property
    def profile(self) -> tuple[float, float, float]:
        """Radius at the top and at the bottom, and height (m)."""
        return self.top_radius, self.bottom_radius, self.length


def _contains(shape: TruncatedCone, p: Array) -> Booleans:
    top, bottom, length = shape.profile
    rim, up = np.hypot(p[:, 0], p[:, 1]), p[:, 2] + length / 2
    return np.asarray((np.abs(p[:, 2]) <= length / 2) & (rim * length <= bottom * (length - up) + top * up))


def _row(shape: TruncatedCone, _: Any) -> Row:
    top, bottom, half = shape.top_radius, shape.bottom_radius, shape.length / 2
    radius = float(np.hypot(max(top, bottom), half))
    if top == bottom:
        return Row(CYLINDER, (top, half), radius)
    return Row(TRUNCATED_CONE, (bottom, half, top), radius)  # size: bottom radius, half height, top radius


KIND: Final = Kind(
    number=ShapeType.TRUNCATED_CONE,
    name="truncated cone",
    shape=TruncatedCone,
    dimensions="bottom radius, top radius, length",
    fields=fields_of("bottom_radius", "top_radius", "length"),
    make=made_of(TruncatedCone),
    row=_row,
    support=lambda shape, d: support_of_revolved(d, *shape.profile),
    contains=_contains,
    rays=lambda shape, p, d: [revolved_interval(p, d, *shape.profile)],
    triangles=lambda shape: revolved_surface(*shape.profile),
    mass=lambda shape, density: revolved_mass(shape.top_radius, shape.bottom_radius, shape.length, density),
    feature=lambda shape, x, n, tie, off: feature_of_revolved(x, n, *shape.profile),
    scaled=lambda shape, factor: TruncatedCone(
        factor * shape.bottom_radius, factor * shape.top_radius, factor * shape.length
    ),
    curved=True,
    round=True,
    revolved=True,
    exact=True,
)
