"""Two movable bodies without rotation: velocities after they meet. Normals point from A to B."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from collision_monitor.errors import InputError
from collision_monitor.geometry.coordinates import Array
from collision_monitor.response.checks import checked_direction, masses, restitutions, vectors
from collision_monitor.response.planes import normal_part


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
    bodies that stay in contact. Bodies that already separate keep their velocities.
    """
    va, vb, approaching, closing = _approach(velocity_a, velocity_b, normal)
    share_a, share_b = _shares(mass_a, mass_b)
    change = np.where(approaching, (1.0 + restitutions(restitution)) * closing, 0.0)
    return va - share_a * change, vb + share_b * change


def stick(velocity_a: ArrayLike, velocity_b: ArrayLike, mass_a: ArrayLike, mass_b: ArrayLike) -> Array:
    """Common velocity of two bodies that stay together: slide "Inelastic Collisions", momentum is conserved.

    Raises InputError for two immovable bodies, which have no common velocity.
    """
    va, vb = vectors(("velocity A", velocity_a), ("velocity B", velocity_b))
    share_a, share_b = _shares(mass_a, mass_b)
    if ((share_a == 0.0) & (share_b == 0.0)).any():
        raise InputError("mass: expected a movable body in each pair that sticks together, got two infinite masses")
    return np.asarray(share_b * va + share_a * vb)


def average(velocity_a: ArrayLike, velocity_b: ArrayLike, normal: ArrayLike) -> tuple[Array, Array]:
    """Both velocities replaced by their mean, if the bodies approach.

    Slide "Other object vs. object ideas": averaging velocities. It is `stick` for equal masses; for others it does
    not conserve momentum.
    """
    va, vb, approaching, _ = _approach(velocity_a, velocity_b, normal)
    mean = 0.5 * va + 0.5 * vb
    return np.where(approaching, mean, va), np.where(approaching, mean, vb)


def swap(velocity_a: ArrayLike, velocity_b: ArrayLike, normal: ArrayLike) -> tuple[Array, Array]:
    """Velocities exchanged, if the bodies approach.

    Slide "Other object vs. object ideas": swap velocities. It is `collide` for equal masses that meet head-on; a
    glancing hit also exchanges the sideways velocities, which no frictionless contact does.
    """
    va, vb, approaching, _ = _approach(velocity_a, velocity_b, normal)
    return np.where(approaching, vb, va), np.where(approaching, va, vb)


def _approach(
    velocity_a: ArrayLike, velocity_b: ArrayLike, normal: ArrayLike
) -> tuple[Array, Array, np.ndarray[tuple[int, ...], np.dtype[np.bool_]], Array]:
    """Velocities, whether the bodies approach, and the part of A's velocity relative to B along the normal."""
    va, vb, _ = vectors(("velocity A", velocity_a), ("velocity B", velocity_b), ("normal", normal))
    n, closing = checked_direction(normal), va - vb
    return va, vb, np.sum(closing * n, axis=-1, keepdims=True) > 0.0, normal_part(closing, n)


def _shares(mass_a: ArrayLike, mass_b: ArrayLike) -> tuple[Array, Array]:
    """Parts of a change of relative velocity that A and B take, as to their inverse masses; 0 if immovable."""
    ma, mb = masses(mass_a, "mass A"), masses(mass_b, "mass B")
    with np.errstate(over="ignore", invalid="ignore"):
        share_a, share_b = 1.0 / (1.0 + ma / mb), 1.0 / (1.0 + mb / ma)
    return np.where(np.isinf(ma), 0.0, share_a), np.where(np.isinf(mb), 0.0, share_b)
