"""Resting contacts: the impulses that hold bodies against each other during a step, with Coulomb friction."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from collision_monitor.checks.numbers import as_numbers, checked_array
from collision_monitor.errors import InputError
from collision_monitor.geometry.coordinates import Array
from collision_monitor.response.contact_set import Bodies, Contacts, solve


class ContactImpulses(NamedTuple):
    """Result of `hold_contacts`.

    bodies: with their new velocities; impulse (M, 3): along the normal and sideways (N s), the start for the next
    step; residual (m/s): by how much a contact still opens too slowly, at most; iterations: passes over the contacts.
    """

    bodies: Bodies
    impulse: Array
    residual: float
    iterations: int


def hold_contacts(
    bodies: Bodies,
    contacts: Contacts,
    opening: ArrayLike = 0.0,
    friction: ArrayLike = 0.0,
    impulse: Array | None = None,
    earlier: ArrayLike = 0.0,
    iterations: int = 200,
    tolerance: float = 1e-10,
) -> ContactImpulses:
    """Impulses with which each contact opens at `opening` (M,) m/s or more, after gravity has acted on the velocities.

    opening: 0 for a contact that touches; -gap / step for bodies that are apart, so that they may close the gap within
    the step. friction (M,): Coulomb's coefficient. impulse (M, 3): the result of the last step for the same contacts;
    with it, a stack at rest needs one pass. earlier (M,): normal impulses (N s) that already acted in this step, which
    count for friction. The search ends after `iterations` passes or when no velocity changes by more than `tolerance`
    (m/s). Slide "Additional issues": resting contact. Source: `contact_set.solve`. Raises InputError.
    """
    count = len(contacts.a)
    contacts.check(len(bodies.inverse_mass))
    start = np.zeros((count, 3)) if impulse is None else np.array(as_numbers(impulse, "impulse"))
    if start.shape != (count, 3):
        raise InputError(f"impulse: expected shape ({count}, 3), one row for each contact, got {start.shape}")
    target, mu, budget = (
        np.broadcast_to(value, count).astype(np.float64)
        for value in (
            checked_array(opening, "opening"),
            checked_array(friction, "friction", least=0.0),
            checked_array(earlier, "earlier", least=0.0),
        )
    )
    after, used = solve(bodies, contacts, target, mu, budget, start, iterations, tolerance)
    residual = float((target + contacts.closing(after)).max(initial=0.0))
    return ContactImpulses(after, start, residual, used)
