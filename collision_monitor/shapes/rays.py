"""Rays against the solids that shapes are made of: clipped intervals of planes, quadratics.

A ray is p + t d, with a unit vector d and t in m. (Slides "Line intersection", "Ray test", "Edge intersection face
test"; Kay and Kajiya, 1986, for the clipping)
"""

from __future__ import annotations

from typing import Final, NamedTuple

import numpy as np

from collision_monitor.errors import InputError
from collision_monitor.geometry.coordinates import Array, Booleans

RAYS_AT_ONCE: Final = 1 << 20
"""Pairs of a ray and an edge or a face in one batch, which limits the temporary arrays to 200 MB."""


class RayInterval(NamedTuple):
    """Part of each ray in a convex solid: t from enter (...) to leave (...); empty if enter > leave."""

    enter: Array
    leave: Array
    normal: Array  # (..., 3) outward unit normal where it enters


def check_direction_in_plane(d: Array) -> None:
    """Raise InputError for a direction out of the x-y plane."""
    if d[:, 2].any():
        raise InputError("direction: expected one in the x-y plane for a Circle or a Polygon, got one out of it")


def ball_interval(p: Array, d: Array, radius: float) -> RayInterval:
    """A ball about the origin."""
    middle = -row_dot(p, d)
    across = p + middle[..., None] * d  # the ray's point nearest to the centre: its square does not cancel
    rest = radius * radius - row_dot(across, across)
    half = np.sqrt(np.maximum(rest, 0.0))
    enter = np.where(rest >= 0.0, middle - half, np.inf)
    return RayInterval(enter, np.where(rest >= 0.0, middle + half, -np.inf), (across - half[..., None] * d) / radius)


def planes_interval(normal: Array, offset: Array, p: Array, d: Array) -> RayInterval:
    """Intersection of half-spaces {x : n.x <= offset}."""
    height, speed = p @ normal.T - offset, d @ normal.T
    with np.errstate(divide="ignore", invalid="ignore"):
        t = -height / speed
    enter = np.where(speed < 0.0, t, np.where((speed == 0.0) & (height > 0.0), np.inf, -np.inf))
    leave = np.where(speed > 0.0, t, np.inf)
    which = enter.argmax(axis=1)
    return RayInterval(enter.max(axis=1), leave.min(axis=1), normal[which])


def tube_interval(p: Array, d: Array, radius: float) -> RayInterval:
    """An infinite cylinder about z."""
    u, w = d * [1.0, 1.0, 0.0], p * [1.0, 1.0, 0.0]
    square = row_dot(u, u)
    along = square == 0.0
    scale = np.where(along, 1.0, square)
    middle = -row_dot(w, u) / scale
    across = w + middle[:, None] * u
    rest = radius * radius - row_dot(across, across)
    half = np.where(along, np.inf, np.sqrt(np.maximum(rest, 0.0) / scale))
    enter, leave = np.where(rest >= 0.0, middle - half, np.inf), np.where(rest >= 0.0, middle + half, -np.inf)
    finite = np.where(np.isfinite(half), half, 0.0)
    return RayInterval(enter, leave, (across - finite[:, None] * u) / radius)


def slab_interval(p: Array, d: Array, half: float) -> RayInterval:
    """The slab |z| <= half."""
    axis = np.array([[0.0, 0.0, 1.0], [0.0, 0.0, -1.0]])
    return planes_interval(axis, np.full(2, half), p, d)


def common_interval(a: RayInterval, b: RayInterval) -> RayInterval:
    """The common part of two convex solids."""
    later = (a.enter >= b.enter)[:, None]
    return RayInterval(np.maximum(a.enter, b.enter), np.minimum(a.leave, b.leave), np.where(later, a.normal, b.normal))


def from_outside(within: Booleans, best: Array, normal: Array) -> tuple[Array, Array]:
    """Hits of rays, where those from within start at 0 without a normal."""
    outside = np.isfinite(best) & ~within
    return np.where(within, 0.0, best), np.where(outside[:, None], normal, 0.0)


def row_dot(a: Array, b: Array) -> Array:
    """Scalar products along the last axis."""
    return np.asarray((a * b).sum(axis=-1))
