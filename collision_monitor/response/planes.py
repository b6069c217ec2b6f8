"""A body and a stationary wall, plane or ground: velocities and positions after they meet."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from collision_monitor.checks.numbers import checked_array
from collision_monitor.geometry.coordinates import Array
from collision_monitor.response.checks import checked_direction, restitutions, unit, vectors


def normal_part(vector: Array, normal: Array) -> Array:
    """Component of a vector along the normal: u = (v.n / n.n) n."""
    along = np.sum(vector * normal, axis=-1, keepdims=True) / np.sum(normal * normal, axis=-1, keepdims=True)
    return np.asarray(along * normal)


def reflect(velocity: ArrayLike, normal: ArrayLike, restitution: ArrayLike = 1.0) -> Array:
    """Velocity after a collision with a stationary wall or plane of any angle, with its normal towards the body.

    Slides "Elastic collision with stationary object: horizontal and vertical walls/planes" and ": angled
    walls/planes": v = u + w, and v' = w - u; "Collision response: damped": restitution times u. A body that already
    leaves the wall (v.n >= 0) keeps its velocity.
    """
    v, _ = vectors(("velocity", velocity), ("normal", normal))
    n, e = checked_direction(normal), restitutions(restitution)
    u = normal_part(v, n)
    approaching = np.sum(v * n, axis=-1, keepdims=True) < 0.0
    return np.where(approaching, v - u - e * u, v)


def clamp(position: ArrayLike, normal: ArrayLike, offset: ArrayLike = 0.0, radius: ArrayLike = 0.0) -> Array:
    """Position of a sphere (or of a point, radius 0), moved along the normal onto the plane if it is beyond.

    The plane is that of HalfSpace(normal, offset): the solid is {x : n.x <= offset}, with a unit normal. Slide "Other
    object vs. plane ideas": position clamping.
    """
    p, n, depth = _depth(position, normal, offset, radius)
    return np.asarray(p + np.maximum(depth, 0.0) * n)


def last_free(
    previous: ArrayLike, position: ArrayLike, normal: ArrayLike, offset: ArrayLike = 0.0, radius: ArrayLike = 0.0
) -> Array:
    """The position, or the previous one if the position is beyond the plane. Arguments as in `clamp`.

    Slide "Other object vs. plane ideas": return to previous position. Unlike clamping it also undoes the way along the
    plane, so a body that keeps pushing does not move at all.
    """
    before, _ = vectors(("previous", previous), ("position", position))
    p, _, depth = _depth(position, normal, offset, radius)
    return np.where(depth > 0.0, before, p)


def _depth(position: ArrayLike, normal: ArrayLike, offset: ArrayLike, radius: ArrayLike) -> tuple[Array, Array, Array]:
    p, _ = vectors(("position", position), ("normal", normal))
    n, reach = (
        unit(normal),
        checked_array(offset, "offset")[..., None] + checked_array(radius, "radius", least=0.0)[..., None],
    )
    return p, n, np.asarray(reach - np.sum(p * n, axis=-1, keepdims=True))
