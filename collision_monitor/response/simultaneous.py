"""Impacts of all contacts of one instant, solved together, so that symmetric cases stay symmetric."""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import ArrayLike

from collision_monitor.errors import InputError
from collision_monitor.geometry.coordinates import Array
from collision_monitor.response.checks import restitutions
from collision_monitor.response.contact_set import Bodies, Contacts, solve

ITERATIONS: Final = 10_000
"""Default limit of the passes over the contacts; a row of 10 equal balls takes 500."""

ROUNDS: Final = 200
"""Default limit of the reflections. A row of n balls takes n; more happen only where round-off cannot settle."""

CLOSED: Final = 1e-10
"""A contact that closes slower than this part of the fastest speed counts as closed."""


def collide_together(
    velocity: ArrayLike, mass: ArrayLike, pairs: ArrayLike, normal: ArrayLike, restitution: float = 1.0
) -> Array:
    """Velocities (N, 2 or 3) after all contacts of one instant; bodies do not turn.

    pairs (M, 2): indices of bodies A and B in contact; normal (M, 2 or 3): from A to B. See `bodies_collide_together`.
    Raises InputError.
    """
    bodies = Bodies.without_rotation(mass, velocity)
    after, _ = bodies_collide_together(bodies, Contacts.between(pairs, normal), restitution)
    return np.asarray(after.velocity[:, : np.shape(velocity)[-1]])


def bodies_collide_together(
    bodies: Bodies,
    contacts: Contacts,
    restitution: float = 1.0,
    iterations: int = ITERATIONS,
    rounds: int = ROUNDS,
) -> tuple[Bodies, Array]:
    """Bodies after the impacts of all contacts, and the normal impulses (M,) in N s; without friction.

    Elastic part: the velocities are mirrored at the contacts that close, all at once, until none closes, so a row of
    balls passes a hit on and two balls that hit a middle one from both sides bounce back alike. Inelastic part: the
    least impulses with which no contact closes. The answer is their mean, weighted with the restitution. Momentum is
    conserved, energy never grows, and no contact closes; wedged bodies that no velocity parts stop. (Generalized
    Reflections: Smith, Kaufman, Vouga, Tamstorf, Grinspun, "Reflections on Simultaneous Impact", 2012; slide
    "Additional issues": handling multiple collisions)
    Raises InputError.
    """
    contacts.check(len(bodies.inverse_mass))
    e = restitutions(restitution)
    if e.shape != (1,):
        raise InputError(f"restitution: expected one number for all contacts, got an array of shape {e.shape[:-1]}")
    closed = CLOSED * contacts.fastest(bodies)
    stopped, impulse = _stop(bodies, contacts, iterations, 1e-3 * closed)
    if e[0] == 0.0:
        return stopped, impulse
    mirrored, total = bodies, np.zeros(len(contacts.a))
    for _ in range(rounds):
        which = np.flatnonzero(contacts.closing(mirrored) > closed)
        if not len(which):
            break
        halfway, part = _stop(mirrored, contacts.take(which), iterations, 1e-3 * closed)
        mirrored = mirrored._replace(
            velocity=2.0 * halfway.velocity - mirrored.velocity, angular=2.0 * halfway.angular - mirrored.angular
        )
        total[which] += 2.0 * part
    else:
        mirrored, part = _stop(mirrored, contacts, iterations, 1e-3 * closed)
        total += part
    blend = float(e[0])
    return (
        bodies._replace(
            velocity=(1.0 - blend) * stopped.velocity + blend * mirrored.velocity,
            angular=(1.0 - blend) * stopped.angular + blend * mirrored.angular,
        ),
        (1.0 - blend) * impulse + blend * total,
    )


def _stop(bodies: Bodies, contacts: Contacts, iterations: int, tolerance: float) -> tuple[Bodies, Array]:
    """Bodies after the least impulses (M,) with which no contact closes."""
    count = len(contacts.a)
    impulse, none = np.zeros((count, 3)), np.zeros(count)
    after, _ = solve(bodies, contacts, none, none, none, impulse, iterations, tolerance)
    return after, impulse[:, 0]
