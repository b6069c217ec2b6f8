"""Collision response of bodies in simulated worlds; the monitor itself never changes a motion.

Vectors are (..., 3) or (..., 2), in m and m/s; normals need not be of unit length; everything broadcasts.
Source of all but `bounce_between_walls`: the collision response part of the lecture "Collision handling: detection
and response"; each function names its slide.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]


def _normal_part(vector: Array, normal: Array) -> Array:
    """Component of a vector along the normal: u = (v.n / n.n) n."""
    along = np.sum(vector * normal, axis=-1, keepdims=True) / np.sum(normal * normal, axis=-1, keepdims=True)
    part: Array = along * normal
    return part


def reflect(velocity: ArrayLike, normal: ArrayLike, restitution: ArrayLike = 1.0) -> Array:
    """Velocity after hitting a stationary wall or plane with its normal towards the body.

    Slides "Elastic collision with stationary object: horizontal and vertical walls/planes" and ": angled
    walls/planes": v = u + w, and v' = w - u; "Collision response: damped": restitution times u. A body that already
    leaves the wall (v.n >= 0) keeps its velocity.
    """
    v, n = np.asarray(velocity, dtype=np.float64), np.asarray(normal, dtype=np.float64)
    u = _normal_part(v, n)
    approaching = np.sum(v * n, axis=-1, keepdims=True) < 0.0
    return np.where(approaching, v - u - np.asarray(restitution)[..., None] * u, v)


def collide(
    velocity_a: ArrayLike,
    velocity_b: ArrayLike,
    normal: ArrayLike,
    mass_a: ArrayLike,
    mass_b: ArrayLike,
    restitution: ArrayLike = 1.0,
) -> tuple[Array, Array]:
    """Velocities after a collision of two free bodies; normal from A to B (spheres: along the line of centres).

    Slides "Elastic collision with movable object" (only the momentum along the normal changes) and "Inelastic
    Collisions": the coefficient of restitution is the ratio of separating to approaching speed, 1 for elastic, 0 for
    bodies that stay in contact. Bodies that already separate keep their velocities. Masses in kg.
    """
    va, vb = np.asarray(velocity_a, dtype=np.float64), np.asarray(velocity_b, dtype=np.float64)
    n = np.asarray(normal, dtype=np.float64)
    ma = np.asarray(mass_a, dtype=np.float64)[..., None]
    mb = np.asarray(mass_b, dtype=np.float64)[..., None]
    closing = va - vb
    approaching = np.sum(closing * n, axis=-1, keepdims=True) > 0.0
    exchanged = (1.0 + np.asarray(restitution, dtype=np.float64)[..., None]) * _normal_part(closing, n) / (ma + mb)
    exchanged = np.where(approaching, exchanged, 0.0)  # impulse divided by the product of the masses
    return va - mb * exchanged, vb + ma * exchanged


def stick(velocity_a: ArrayLike, velocity_b: ArrayLike, mass_a: ArrayLike, mass_b: ArrayLike) -> Array:
    """Common velocity of two bodies that stay together: slide "Inelastic Collisions", momentum is conserved."""
    va, vb = np.asarray(velocity_a, dtype=np.float64), np.asarray(velocity_b, dtype=np.float64)
    ma = np.asarray(mass_a, dtype=np.float64)[..., None]
    mb = np.asarray(mass_b, dtype=np.float64)[..., None]
    common: Array = (ma * va + mb * vb) / (ma + mb)
    return common


def penalty_force(
    depth: ArrayLike, closing_speed: ArrayLike, normal: ArrayLike, stiffness: float, damping: float = 0.0
) -> Array:
    """Force (N) of a spring (N/m) and a damper (N s/m) that push a body out along the normal.

    depth: m, positive for penetration; closing_speed: m/s, positive if the depth grows. Slides "Penalty method normal
    spring force", "Collision response: penalty" and ": damped". The force never pulls, as a damper alone would hold the
    body on the surface on its way out.
    """
    depth, n = np.asarray(depth, dtype=np.float64), np.asarray(normal, dtype=np.float64)
    push = np.maximum(stiffness * depth + damping * np.asarray(closing_speed, dtype=np.float64), 0.0)
    size = np.where(depth > 0.0, push, 0.0)[..., None]
    force: Array = size * n / np.linalg.norm(n, axis=-1, keepdims=True)
    return force


def bounce_between_walls(
    position: Array, velocity: Array, low: Array, high: Array, dt: float, restitution: float = 1.0
) -> tuple[Array, Array]:
    """Position and velocity after `dt` seconds between axis-aligned walls, with each bounce at its exact time.

    low, high: where the body's centre turns back. Bounce k ends a crossing of high - low at the speed
    restitution**k |v|, so the times of the bounces are a geometric series. Below 1, the number of bounces in `dt` is
    its solution, however many they are; a body with restitution 0 stays at the wall. Source: own derivation.
    """
    moved = position + velocity * dt
    inside = (moved >= low) & (moved <= high)  # kept without any round-off
    room, speed = high - low, np.abs(velocity)
    with np.errstate(all="ignore"):  # where nothing bounces, the formulas divide by 0
        to_wall = np.where(velocity > 0.0, high - position, position - low)
        left = np.maximum(dt - to_wall / speed, 0.0)  # after the first bounce
        travelled = left * speed / room  # crossings after it without loss
        if restitution == 1.0:
            crossings = begun = np.floor(travelled)
        else:
            decay = -np.log(restitution)  # infinite for 0
            crossings = np.floor(np.log1p(travelled * (1.0 - restitution)) / decay)
            begun = np.where(crossings > 0.0, np.expm1(crossings * decay), 0.0) / (1.0 - restitution)
        after = restitution ** (crossings + 1.0)
        from_wall = np.clip((left - begun * room / speed) * after * speed, 0.0, room)
    upwards = (velocity > 0.0) == (np.mod(crossings, 2.0) == 1.0)
    bounced = np.where(upwards, low + from_wall, high - from_wall)
    return (
        np.where(inside, moved, np.clip(bounced, low, high)),
        np.where(inside, velocity, np.where(upwards, after * speed, -after * speed)),
    )
