"""The polygon, in the x-y plane, convex or concave, sharp or rounded."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from collision_monitor.errors import ShapeError
from collision_monitor.geometry.contact_features import Feature
from collision_monitor.geometry.point_in_polygon import Location, locate_in_polygon
from collision_monitor.geometry.points import closest_point_on_segment
from collision_monitor.geometry.polygons import is_convex, is_counter_clockwise, polygon_corners
from collision_monitor.geometry.ray_crossings import edge_hits
from collision_monitor.geometry.round_features import feature_of_outline
from collision_monitor.records import ShapeType
from collision_monitor.shapes.kind import Booleans, Corners, Fields, Kind, Row
from collision_monitor.shapes.rays import RAYS_AT_ONCE, ball_interval, check_direction_in_plane, from_outside, row_dot
from collision_monitor.shapes.shape import Array, Shape, point_rows, positive
from collision_monitor.shapes.surface_parts import SIDES, Triangles, outline_triangles

POLYGON: Final = int(ShapeType.POLYGON)


@dataclass(frozen=True, eq=False)
class Polygon(Shape):
    """Polygon in the x-y plane: points (n, 2) in m around the boundary of a simple polygon, convex or concave.

    radius: the polygon is grown by this length (m), which rounds its corners. With a radius, two points make a capsule.

    >>> Polygon([(0, 0), (1, 0), (0, 1)]).points.shape
    (3, 2)
    """

    points: Any
    radius: float = 0.0

    def __post_init__(self) -> None:
        radius = positive(self.radius, "Polygon radius", or_zero=True)
        points = point_rows(self.points, "Polygon points", 2, 2 if radius else 3)
        if len(points) == 2 and (points[0] == points[1]).all():
            raise ShapeError("Polygon points: expected two different points, got the same twice (use a Circle)")
        object.__setattr__(self, "points", points)
        object.__setattr__(self, "radius", float(radius))


def convex_ring(points: Array) -> NDArray[np.int32]:
    """Corner indices (n,) of a polygon (m, 2), counter-clockwise. Raises ShapeError if it is not convex."""
    if len(points) == 2:
        return np.arange(2, dtype=np.int32)
    if not is_convex(points):
        raise ShapeError("Polygon points: expected a convex polygon, got a concave one; see triangulation.convex_parts")
    ring = polygon_corners(points)
    return (ring if is_counter_clockwise(points) else ring[::-1]).astype(np.int32)


def _row(shape: Polygon, _: Corners | None) -> Row:
    """size: number of corners. The radius is part of the margin."""
    ring = convex_ring(shape.points)
    radius = float(np.linalg.norm(shape.points, axis=1).max())
    return Row(POLYGON, (len(ring),), radius, shape.radius, np.pad(shape.points, ((0, 0), (0, 1))), ring)


def _make(fields: Fields) -> Polygon:
    if len(fields.dimensions) > 1:
        raise ShapeError(f"Polygon: expected no dimensions, or 1 (radius), got {len(fields.dimensions)}")
    return Polygon(fields.vertices[:, :2], *fields.dimensions)


def _fields(shape: Polygon) -> Fields:
    level = np.column_stack([shape.points, np.zeros(len(shape.points))])
    return Fields((shape.radius,) if shape.radius else (), level)


def _contains(shape: Polygon, p: Array) -> Booleans:
    """Whether points are in the polygon or within its radius of an edge."""
    p, start = p[:, :2], np.asarray(shape.points)
    if shape.radius == 0.0:
        return np.asarray(locate_in_polygon(p, start)) != Location.OUTSIDE
    at, _ = closest_point_on_segment(p[:, None], start, np.roll(start, -1, axis=0))
    near = (np.hypot(*np.moveaxis(at - p[:, None], -1, 0)) <= shape.radius).any(axis=1)
    if len(start) == 2:
        return np.asarray(near)
    return np.asarray(near | (np.asarray(locate_in_polygon(p, start)) != Location.OUTSIDE))


def _first_hits(shape: Polygon, p: Array, d: Array) -> tuple[Array, Array]:
    """Nearest edge on the way. With a radius: edges moved by it to both sides, and discs about the corners."""
    check_direction_in_plane(d)
    start = np.asarray(shape.points)
    end = np.roll(start, -1, axis=0)
    across = (end - start)[:, ::-1] * [1.0, -1.0]
    length = np.linalg.norm(across, axis=1, keepdims=True)
    across /= np.where(length > 0.0, length, 1.0)
    corners = np.pad(start, ((0, 0), (0, 1)))
    if shape.radius > 0.0:
        aside = shape.radius * across
        start, end = np.concatenate([start + aside, start - aside]), np.concatenate([end + aside, end - aside])
        across = np.concatenate([across, across])
    best, normal = np.full(len(p), np.inf), np.zeros_like(p)
    step = max(RAYS_AT_ONCE // len(start), 1)
    for first in range(0, len(p), step):
        o, way = p[first : first + step, None], d[first : first + step, None]
        t = edge_hits(o[..., :2], way[..., :2], start, end)
        n = np.pad(-np.sign(row_dot(way[..., :2], across))[..., None] * across, ((0, 0), (0, 0), (0, 1)))
        if shape.radius > 0.0:
            disc = ball_interval(o * [1.0, 1.0, 0.0] - corners, way, shape.radius)
            t = np.concatenate([t, np.where(disc.enter >= 0.0, disc.enter, np.inf)], axis=1)
            n = np.concatenate([n, disc.normal], axis=1)
        rows, which = np.arange(len(t)), t.argmin(axis=1)
        best[first : first + step], normal[first : first + step] = t[rows, which], n[rows, which]
    return from_outside(_contains(shape, p), best, normal)


def _triangles(shape: Polygon) -> Triangles:
    turn = np.linspace(0.0, 2 * np.pi, SIDES, endpoint=False)
    corner = shape.radius * np.stack([np.cos(turn), np.sin(turn)], axis=1)
    rounded = shape.points if shape.radius else shape.points[:0]
    return np.concatenate([outline_triangles(ring) for ring in (shape.points, *(at + corner for at in rounded))])


def _feature(shape: Polygon, point: Array, normal: Array, tie: float, off: float) -> Feature:
    return feature_of_outline(point[:2] - shape.radius * normal[:2], normal[:2], shape.points)


def _support(shape: Polygon, d: Array) -> Array:
    rim = np.hypot(d[..., 0], d[..., 1])
    return np.asarray((d[..., :2] @ shape.points.T).max(axis=-1) + shape.radius * rim)


KIND: Final = Kind(
    number=ShapeType.POLYGON,
    name="polygon",
    shape=Polygon,
    fields=_fields,
    make=_make,
    row=_row,
    support=_support,
    contains=_contains,
    first_hits=_first_hits,
    triangles=_triangles,
    feature=_feature,
    middle=lambda shape: np.append(shape.points.mean(axis=0), 0.0),
    planar=True,
    simple=False,
)
