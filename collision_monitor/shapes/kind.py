"""What the package knows of a kind of shape, beside its kernels: one record for each, made in its file in `kinds/`."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from collision_monitor.geometry.contact_features import Feature
from collision_monitor.records import ShapeType
from collision_monitor.shapes.mass import MassProperties
from collision_monitor.shapes.rays import RayInterval
from collision_monitor.shapes.shape import Array, Shape

Booleans = NDArray[np.bool_]
Corners = NDArray[np.int32]


class Row(NamedTuple):
    """A shape as a slot of the shape table."""

    number: int  # kind of the slot: a round ellipsoid is a sphere
    size: tuple[float, ...]  # at most 4 numbers, whose meaning the kind says
    radius: float  # of the bounding sphere about the origin, without the margin (m); infinite for a half-space
    margin: float = 0.0  # by which the slot is grown (m)
    points: Array | None = None  # (n, 3) m
    ring: Corners | None = None  # the points that are vertices


class Fields(NamedTuple):
    """A shape as the fields of the message Shape."""

    dimensions: tuple[float, ...]
    vertices: Array = np.zeros((0, 3))
    triangles: NDArray[Any] = np.zeros((0, 3), np.uint32)
    data: NDArray[np.uint8] = np.zeros(0, np.uint8)


@dataclass(frozen=True, kw_only=True)
class Kind:
    """A kind of shape. The functions take a shape of the kind; points and directions are in the shape's frame, in m."""

    number: ShapeType
    name: str
    shape: type[Shape]

    dimensions: str = ""
    """What the numbers of a message mean, as "radius, length"; empty: it may have none."""
    fields: Callable[[Any], Fields]
    make: Callable[[Fields], Shape]
    """The shape of a message's dimensions, vertices (n, 3), triangles (k,) and data (b,). Raises ShapeError."""

    row: Callable[[Any, Corners | None], Row | None]
    """Its slot of the table, with its corners if they are known already; None: kernels see a tree of its surface."""
    support: Callable[[Any, Array], Array]
    """max d . x over the shape (...,) for unit directions d (..., 3); the slow definition that tests the kernels."""
    contains: Callable[[Any, Array], Booleans]
    """Mask (n,) of the points (n, 3) in the shape, boundary included. Raises UnsupportedError."""
    rays: Callable[[Any, Array, Array], list[RayInterval]] | None = None
    """Where rays p + t d (n, 3) are in each of the convex solids that make up the shape."""
    first_hits: Callable[[Any, Array, Array], tuple[Array, Array]] | None = None
    """As `ray_casting.first_hits`, in place of `rays`, for a shape that is not made up of a few convex solids."""
    triangles: Callable[[Any], Array]
    """Coarse triangles (n, 3, 3) of the surface, for display."""
    mass: Callable[[Any, float], MassProperties | None] | None = None
    """Mass properties for a density (kg/m³). None, or an answer of None: it has no volume."""
    feature: Callable[[Any, Array, Array, float, float], Feature] | None = None
    """Feature at a point (3,) for an outward normal (3,), a relative tie, and an error of the point (m)."""
    scaled: Callable[[Any, float], Shape] | None = None
    """The shape scaled about its origin; None: no robot model has such a shape."""

    corners: Callable[[Any], Array] | None = None
    """Points (n, 3) whose hull is the shape, or the shape without its rounding; None: it is round or unbounded."""
    middle: Callable[[Any], Array] | None = None
    """A point (3,) of the shape; None: its origin."""
    farthest: Callable[[Any], Array] | None = None
    """A direction (3,) in which a shape that is symmetric about its origin reaches farthest; None: it is not."""

    curved: bool = False  # its core has a round surface: EPA and features need larger tolerances
    round: bool = False  # no polytope: hulls with others are not offered
    revolved: bool = False  # about its z axis
    ball: bool = False  # it looks the same however it is turned (a circle: in its plane)
    planar: bool = False  # in the x-y plane
    bounded: bool = True
    simple: bool = True  # a few numbers, and nothing about it takes long
    exact: bool = False  # the distance of a point has a closed form, see calls.point_distance_range

    @property
    def expected_dimensions(self) -> int:
        """Number of dimensions in a message; 0: `make` checks them."""
        return self.dimensions.count(",") + 1 if self.dimensions else 0


def fields_of(*names: str) -> Callable[[Any], Fields]:
    """`fields` of a shape whose numbers are these attributes."""
    return lambda shape: Fields(tuple(getattr(shape, name) for name in names))


def made_of(shape: type[Any]) -> Callable[[Fields], Shape]:
    """`make` of a shape that takes the numbers one by one."""
    return lambda fields: shape(*fields.dimensions)
