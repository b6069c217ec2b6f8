"""Zones of the world in which rules count or do not count: boxes, prisms over polygons, half-spaces."""

from __future__ import annotations

from dataclasses import dataclass
from math import inf

import numpy as np
from numpy.typing import NDArray

from collision_monitor.settings.yaml_entry import YamlEntry

Array = NDArray[np.float64]

LEAST_SIZE = 1e-6
"""m: a zone that is thinner, or a polygon of less area (m²), counts as one without volume: surely a mistake."""


@dataclass(frozen=True)
class BoxZone:
    """The points between two corners (m)."""

    low: tuple[float, ...]
    high: tuple[float, ...]

    def distance(self, points: Array) -> Array:
        """Return the signed distance (m) of points (n, 3) from the surface; negative inside."""
        beyond = np.maximum(np.asarray(self.low) - points, points - np.asarray(self.high))
        outside = np.sqrt((np.maximum(beyond, 0.0) ** 2).sum(axis=1))
        return np.asarray(outside + np.minimum(beyond.max(axis=1), 0.0))


@dataclass(frozen=True)
class PolygonZone:
    """The points over a simple polygon in the x-y plane, corners (m) in either order, from z[0] to z[1] (m)."""

    corners: tuple[tuple[float, ...], ...]
    z: tuple[float, float] = (-inf, inf)

    def distance(self, points: Array) -> Array:
        """Return the signed distance (m) of points (n, 3) from the surface; negative inside."""
        a = np.asarray(self.corners)
        along = np.roll(a, -1, axis=0) - a  # (m, 2)
        off = points[:, None, :2] - a  # (n, m, 2)
        t = np.clip((off * along).sum(axis=2) / (along**2).sum(axis=1), 0.0, 1.0)
        flat = np.sqrt(((off - t[:, :, None] * along) ** 2).sum(axis=2)).min(axis=1)
        begins_below = a[:, 1] <= points[:, None, 1]
        ends_below = np.roll(a[:, 1], -1) <= points[:, None, 1]
        to_the_left = along[:, 0] * off[:, :, 1] - along[:, 1] * off[:, :, 0] > 0.0
        crossings = (begins_below & ~ends_below & to_the_left).sum(axis=1)
        crossings -= (~begins_below & ends_below & ~to_the_left).sum(axis=1)
        flat = np.where(crossings != 0, -flat, flat)
        upright = np.maximum(self.z[0] - points[:, 2], points[:, 2] - self.z[1])
        outside = np.sqrt(np.maximum(flat, 0.0) ** 2 + np.maximum(upright, 0.0) ** 2)
        return np.asarray(outside + np.minimum(np.maximum(flat, upright), 0.0))


@dataclass(frozen=True)
class HalfSpaceZone:
    """The points x with normal · x <= offset; the normal has unit length, the offset is in m."""

    normal: tuple[float, ...]
    offset: float

    def distance(self, points: Array) -> Array:
        """Return the signed distance (m) of points (n, 3) from the surface; negative inside."""
        return np.asarray(points @ np.asarray(self.normal) - self.offset)


Zone = BoxZone | PolygonZone | HalfSpaceZone


def read_zone(entry: YamlEntry) -> Zone:
    """Read one zone, such as `{box: [[0, 0, 0], [5, 4, 3]]}`. Raises InputError, also if it has no volume."""
    content = entry.table(("box", "polygon", "z", "half_space"))
    kinds = [key for key in content if key != "z"]
    if len(kinds) != 1:
        raise entry.error("one of box, polygon, half_space", ", ".join(kinds) or "none")
    (kind,) = kinds
    if "z" in content and kind != "polygon":
        raise content["z"].error("z only with a polygon", kind)
    given = content[kind]
    if kind == "box":
        low, high = (corner.numbers(3, "metres") for corner in given.items(2, 2))
        if any(b - a < LEAST_SIZE for a, b in zip(low, high, strict=True)):
            raise given.error("two corners, the lower one first, with a volume between them")
        return BoxZone(low, high)
    if kind == "half_space":
        *normal, offset = given.numbers(4, "metres")
        length = float(np.linalg.norm(normal))
        if length < LEAST_SIZE:
            raise given.error("[nx, ny, nz, offset] with a normal that is not zero")
        return HalfSpaceZone(tuple(x / length for x in normal), offset / length)
    corners = tuple(corner.numbers(2, "metres") for corner in given.items(3, 1000))
    z = content["z"].numbers(2, "metres") if "z" in content else (-inf, inf)
    if z[1] - z[0] < LEAST_SIZE:
        raise content["z"].error("[low, high] with a height between them")
    _check_polygon(given, np.asarray(corners))
    return PolygonZone(corners, (z[0], z[1]))


def _check_polygon(entry: YamlEntry, a: Array) -> None:
    """Refuse a polygon without area, or one that crosses or touches itself. Raises InputError."""
    b = np.roll(a, -1, axis=0)
    along = b - a
    if abs((a[:, 0] * along[:, 1] - a[:, 1] * along[:, 0]).sum()) < 2.0 * LEAST_SIZE or (along == 0.0).all(1).any():
        raise entry.error("different corners that enclose an area")
    n = len(a)
    side_a = _side(a[:, None], b[:, None], a[None]), _side(a[:, None], b[:, None], b[None])
    crosses = (side_a[0] * side_a[1] < 0.0) & (side_a[0] * side_a[1] < 0.0).T
    if crosses[~np.eye(n, dtype=np.bool_)].any():
        raise entry.error("a polygon that does not cross itself")


def _side(a: Array, b: Array, p: Array) -> Array:
    return np.asarray((b - a)[..., 0] * (p - a)[..., 1] - (b - a)[..., 1] * (p - a)[..., 0])
