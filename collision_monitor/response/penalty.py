"""Penalty method: a spring and a damper push bodies apart that overlap. It needs steps short against its period."""

from __future__ import annotations

from math import pi

import numpy as np
from numpy.typing import ArrayLike

from collision_monitor.checks.numbers import checked_array
from collision_monitor.errors import InputError
from collision_monitor.geometry.coordinates import Array
from collision_monitor.response.checks import masses, restitutions, unit


def penalty_force(
    depth: ArrayLike, closing_speed: ArrayLike, normal: ArrayLike, stiffness: ArrayLike, damping: ArrayLike = 0.0
) -> Array:
    """Force (N) of a spring (N/m) and a damper (N s/m) that push a body out along the normal.

    depth: m, positive for penetration; closing_speed: m/s, positive if the depth grows. Slides "Penalty method normal
    spring force", "Collision response: penalty" and ": damped". The force never pulls, as a damper alone would hold the
    body on the surface on its way out.
    """
    d, speed, n = checked_array(depth, "depth"), checked_array(closing_speed, "closing speed"), unit(normal)
    spring, damper = checked_array(stiffness, "stiffness", least=0.0), checked_array(damping, "damping", least=0.0)
    push = np.maximum(spring * d + damper * speed, 0.0)
    return np.asarray(np.where(d > 0.0, push, 0.0)[..., None] * n)


def spring_stiffness(mass: ArrayLike, speed: ArrayLike, depth: ArrayLike) -> Array:
    """Stiffness (N/m) with which a body of this mass and impact speed (m/s) penetrates by `depth` (m), k = m v²/d².

    Raises InputError for an infinite mass and a depth that is not positive.
    """
    m, v, d = masses(mass)[..., 0], checked_array(speed, "speed"), checked_array(depth, "depth")
    if not (np.isfinite(m).all() and (d > 0.0).all()):
        raise InputError("spring: expected a finite mass and a positive depth")
    return np.asarray(m * (v / d) ** 2)


def damping_for(restitution: ArrayLike, stiffness: ArrayLike, mass: ArrayLike) -> Array:
    """Damping (N s/m) that gives a spring (N/m) and a mass (kg) this coefficient of restitution, above 0.

    A half period of the damped oscillation multiplies the speed by exp(-c pi / sqrt(4 k m - c²)); the force of
    `penalty_force` ends earlier, because it never pulls, so a bounce is livelier than stated, by up to 0.1 below 0.5.
    """
    e, k, m = restitutions(restitution)[..., 0], checked_array(stiffness, "stiffness", least=0.0), masses(mass)[..., 0]
    if not (e > 0.0).all():
        raise InputError("restitution: expected above 0 for a damper, got 0, which no finite damping reaches")
    decay = -np.log(e)
    return np.asarray(2.0 * decay * np.sqrt(k * m / (pi * pi + decay * decay)))
