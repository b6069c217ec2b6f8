"""Where many bodies are now, extrapolated from their last states, as arrays."""

from __future__ import annotations

from math import inf
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from collision_monitor._jit import kernel
from collision_monitor.geometry.vector import magnitude
from collision_monitor.motion.bodies import BodyTable
from collision_monitor.motion.course import STRAIGHT
from collision_monitor.motion.last_state import age_of, bending_now, twist_now

Array = NDArray[np.float64]


class LastStates(NamedTuple):
    """The columns of a BodyTable that say where bodies go; a kernel takes them faster than the whole table."""

    static: Any
    time: Any
    position: Any
    linear: Any
    angular: Any
    acceleration: Any
    course: Any
    rest: Any


class Extrapolated(NamedTuple):
    """N bodies at a time; world frame."""

    age: Array  # (N,): s since the last state; 0 for a static one
    position: Array  # (N, 3): m
    velocity: Array  # (N, 3): m/s
    angular: Array  # (N, 3): rad/s
    acceleration: Array  # (N, 3): constant from now on (m/s^2); 0 for a body that bends
    turning: Array  # (N,): bound on the angular speed for `ahead` (rad/s)
    bending: Array  # (N,): bound on the acceleration of a body that brakes or goes along an arc, for `ahead`; else 0


def extrapolated(bodies: BodyTable, slots: NDArray[np.integer[Any]], now: float, ahead: float = 0.0) -> Extrapolated:
    """Extrapolate the bodies in some slots (N,) to `now` (s). ahead: s from then on, for `turning` and `bending`."""
    n = len(slots)
    found = Extrapolated(
        np.empty(n), np.empty((n, 3)), np.empty((n, 3)), np.empty((n, 3)), np.empty((n, 3)), np.empty(n), np.empty(n)
    )  # fmt: skip
    states = LastStates(*(getattr(bodies, name) for name in LastStates._fields))
    _extrapolate(states, np.asarray(slots, np.int64), now, ahead, found)
    return found


@kernel
def _extrapolate(bodies: LastStates, slots: Any, now: float, ahead: float, found: Extrapolated) -> None:
    for k in range(slots.size):
        i = slots[k]
        age = age_of(bodies, i, now)
        found.age[k] = age
        there, is_straight = twist_now(bodies, i, age), bodies.course[i] == STRAIGHT
        for c in range(3):
            found.position[k, c] = bodies.position[i, c] + there.moved[c]
            found.velocity[k, c], found.angular[k, c] = there.velocity[c], there.angular[c]
            found.acceleration[k, c] = bodies.acceleration[i, c] if is_straight else 0.0
        later = 1.0 if bodies.rest[i] < inf or is_straight else abs(1.0 + ahead * there.change)
        found.turning[k] = max(1.0, later) * magnitude(there.angular)
        found.bending[k] = 0.0 if is_straight else bending_now(bodies, i, age, ahead)
