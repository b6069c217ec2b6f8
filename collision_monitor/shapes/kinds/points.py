"""The cloud of points."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Final

import numpy as np

from collision_monitor.errors import ShapeError, UnsupportedError
from collision_monitor.geometry.contact_features import Feature, FeatureType
from collision_monitor.records import ShapeType
from collision_monitor.shapes.kind import Booleans, Fields, Kind
from collision_monitor.shapes.rays import RAYS_AT_ONCE, ball_interval, from_outside
from collision_monitor.shapes.shape import Array, Shape, point_rows, positive
from collision_monitor.shapes.surface_parts import cloud_triangles

POINTS: Final = int(ShapeType.POINTS)

MOST_CLOUD_POINTS: Final = 500_000
"""Points of one cloud. Larger: its tree takes longer than the 100 ms for which one message may hold the answers."""


@dataclass(frozen=True, eq=False, repr=False)
class Points(Shape):
    """Cloud of points (n, 3) in m, each a ball of `radius` in m, as one object: a scan, a depth image, a map.

    The radius may be 0. At most MOST_CLOUD_POINTS points. A cloud encloses nothing.

    >>> Points([(0, 0, 0), (1, 0, 0)], 0.05)
    Points(2 points, radius=0.05)
    """

    points: Any
    radius: float = 0.0

    def __post_init__(self) -> None:
        points = point_rows(self.points, "Points", 3, 1)
        if len(points) > MOST_CLOUD_POINTS:
            raise ShapeError(
                f"Points: expected at most {MOST_CLOUD_POINTS} points, got {len(points)}; "
                "keep one for each cube of a grid, or only those within reach"
            )
        radius = positive(self.radius, "Points radius", or_zero=True)
        object.__setattr__(self, "points", points)
        object.__setattr__(self, "radius", float(radius))

    def __repr__(self) -> str:
        return f"Points({len(self.points)} points, radius={self.radius!r})"


def _contains(shape: Points, p: Array) -> Booleans:
    from scipy.spatial import cKDTree

    return np.asarray(cKDTree(shape.points).query(p)[0] <= shape.radius)


def _first_hits(shape: Points, p: Array, d: Array) -> tuple[Array, Array]:
    """Nearest ball on the way."""
    if shape.radius == 0.0:
        raise UnsupportedError("Points with radius 0: a ray passes between points without a size; give them a radius")
    best, normal = np.full(len(p), np.inf), np.zeros_like(p)
    step = max(RAYS_AT_ONCE // len(shape.points), 1)
    for first in range(0, len(p), step):
        o, way = p[first : first + step, None], d[first : first + step, None]
        ball = ball_interval(o - shape.points, way, shape.radius)
        t = np.where((ball.enter <= ball.leave) & (ball.leave >= 0.0), np.maximum(ball.enter, 0.0), np.inf)
        rows, which = np.arange(len(t)), t.argmin(axis=1)
        best[first : first + step], normal[first : first + step] = t[rows, which], ball.normal[rows, which]
    return from_outside(best == 0.0, best, normal)


def _make(fields: Fields) -> Points:
    if len(fields.dimensions) != 1:
        raise ShapeError(f"Points: expected 1 dimension (radius), got {len(fields.dimensions)}")
    return Points(fields.vertices, float(fields.dimensions[0]))


def _feature(shape: Points, point: Array, normal: Array, tie: float, off: float) -> Feature:
    nearest = int(((shape.points - (point - shape.radius * normal)) ** 2).sum(axis=1).argmin())
    return Feature(FeatureType.VERTEX, (nearest,), -1)


KIND: Final = Kind(
    number=ShapeType.POINTS,
    name="cloud",
    shape=Points,
    fields=lambda shape: Fields((shape.radius,), shape.points),
    make=_make,
    row=lambda shape, _: None,
    support=lambda shape, d: np.asarray((d @ shape.points.T).max(axis=-1) + shape.radius),
    contains=_contains,
    first_hits=_first_hits,
    triangles=lambda shape: cloud_triangles(np.asarray(shape.points), shape.radius),
    feature=_feature,
    simple=False,
)
