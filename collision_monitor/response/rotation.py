"""Collision of two rigid bodies that turn: one impulse at the contact point, with restitution and Coulomb friction."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from collision_monitor.checks.numbers import as_numbers, checked_array
from collision_monitor.errors import InputError
from collision_monitor.geometry.coordinates import Array, coordinates
from collision_monitor.response.checks import masses, restitutions, unit, vectors


class RigidBody(NamedTuple):
    """State of rigid bodies (...), in the world frame.

    mass (...) in kg, infinite for an immovable body; inertia (..., 3, 3) about the centre of mass in kg m², ignored for
    an infinite mass; position (..., 3) of the centre of mass in m; velocity (..., 3) in m/s; angular (..., 3) in rad/s.
    """

    mass: ArrayLike
    inertia: ArrayLike
    position: ArrayLike
    velocity: ArrayLike
    angular: ArrayLike = (0.0, 0.0, 0.0)


def collide_rotating(
    a: RigidBody,
    b: RigidBody,
    point: ArrayLike,
    normal: ArrayLike,
    restitution: ArrayLike = 1.0,
    friction: ArrayLike = 0.0,
) -> tuple[RigidBody, RigidBody]:
    """States after a collision at `point` (..., 3) in m with the normal from A to B; positions stay.

    The impulse is inside the friction cone: if that suffices, the contact points stop sliding, else they slide with
    friction against their velocity (Guendelman, Bridson and Fedkiw, 2003). Where restitution and friction together
    would add energy, the impulse is scaled down until they do not. Bodies that separate at the point keep their
    states. (Slide "Additional issues": adding physics for rotation; Mirtich, 1996)
    """
    p, n = coordinates(point, "point", 3), unit(normal)
    e, mu = restitutions(restitution), checked_array(friction, "friction", least=0.0)[..., None]
    va, wa, arm_a, inverse_a, k_a = _at_point(a, p, "A")
    vb, wb, arm_b, inverse_b, k_b = _at_point(b, p, "B")
    k = k_a + k_b
    slip = va + np.cross(wa, arm_a) - vb - np.cross(wb, arm_b)  # of A against B
    closing = _dot(slip, n)
    meets = (closing > 0.0) & (np.trace(k, axis1=-2, axis2=-1)[..., None] > 0.0)
    k = np.where(meets[..., None], k, np.eye(3))

    stop = np.linalg.solve(k, (slip + e * closing * n)[..., None])[..., 0]  # ends with no sliding
    along = _dot(stop, n)
    sticks = np.linalg.norm(stop - along * n, axis=-1, keepdims=True) <= mu * along
    sliding = slip - closing * n
    speed = np.linalg.norm(sliding, axis=-1, keepdims=True)
    way = n + mu * sliding / np.where(speed > 0.0, speed, 1.0)
    gain = _dot(n, (k @ way[..., None])[..., 0])
    slide = (1.0 + e) * closing / np.where(gain > 0.0, gain, 1.0) * way
    impulse = np.where(sticks | (gain <= 0.0), stop, slide)  # on B; -impulse on A
    work, half = _dot(impulse, slip), 0.5 * _dot(impulse, (k @ impulse[..., None])[..., 0])
    impulse = impulse * np.where(half > work, work / np.where(half > 0.0, half, 1.0), 1.0)
    impulse = np.where(meets, impulse, 0.0)
    return _pushed(a, va, wa, arm_a, inverse_a, -impulse), _pushed(b, vb, wb, arm_b, inverse_b, impulse)


def _at_point(body: RigidBody, point: Array, name: str) -> tuple[Array, Array, Array, Array, Array]:
    """Velocities, lever arm, inverse inertia, and the matrix from an impulse at the point to its velocity."""
    v, w, x = vectors(
        (f"velocity {name}", body.velocity), (f"angular velocity {name}", body.angular),
        (f"position {name}", body.position),
    )  # fmt: skip
    if any(array.shape[-1] != 3 for array in (v, w, x)):
        raise InputError(f"body {name}: expected vectors of space, shape (..., 3)")
    mass, inertia = masses(body.mass, f"mass {name}"), as_numbers(body.inertia, f"inertia {name}")
    if inertia.shape[-2:] != (3, 3):
        raise InputError(f"inertia {name}: expected shape (..., 3, 3), got {inertia.shape}")
    movable = np.isfinite(mass)[..., None]
    inertia = np.where(movable, inertia, np.eye(3))
    if not (np.isfinite(inertia).all() and (np.linalg.eigvalsh(inertia)[..., 0] > 0.0).all()):
        raise InputError(f"inertia {name}: expected a positive definite matrix in kg m²")
    inverse = np.where(movable, np.linalg.inv(inertia), 0.0)
    arm = point - x
    turn = _cross_matrix(arm)
    k = (1.0 / mass)[..., None] * np.eye(3) - turn @ inverse @ turn
    return v, w, arm, np.asarray(inverse), np.asarray(k)


def _pushed(body: RigidBody, v: Array, w: Array, arm: Array, inverse: Array, impulse: Array) -> RigidBody:
    velocity = v + impulse / masses(body.mass)
    return body._replace(velocity=velocity, angular=w + (inverse @ np.cross(arm, impulse)[..., None])[..., 0])


def _cross_matrix(r: Array) -> Array:
    """Matrices (..., 3, 3) with M x = r × x."""
    x, y, z = np.moveaxis(r, -1, 0)
    zero = np.zeros_like(x)
    rows = [[zero, -z, y], [z, zero, -x], [-y, x, zero]]
    return np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)


def _dot(a: NDArray[np.floating[Any]], b: NDArray[np.floating[Any]]) -> Array:
    return np.asarray((a * b).sum(axis=-1, keepdims=True))
