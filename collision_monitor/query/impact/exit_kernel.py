"""Until when two moving objects of the library stay in contact: conservative advancement from inside (Mirtich 1996)."""

from __future__ import annotations

from math import inf, sqrt
from typing import Any, Final, NamedTuple

import numpy as np

from collision_monitor._jit import inlined, kernel, outlined
from collision_monitor.impact.body_contact import RESULT
from collision_monitor.impact.body_impact import Scratch
from collision_monitor.impact.mesh_pair import SURFACES
from collision_monitor.meshes.advance.approach import time_until
from collision_monitor.motion.bodies import Parts
from collision_monitor.motion.motion import (
    MOTION,
    half_acceleration,
    most_turning,
    quaternion_to_matrix,
    relative_velocity,
)
from collision_monitor.motion.stated_motion import NUMBERS
from collision_monitor.motion.trajectory import carry
from collision_monitor.query.contact.contact_kernel import placed_contact
from collision_monitor.query.impact.impact_kernel import set_motion
from collision_monitor.shapes.shape_table import ShapeTable

STEPS: Final = 400
"""Most contacts that are computed on the way to an exit. Each step takes the share of the overlap that the body would
leave if all its points moved the same way; more steps follow slower exits."""


class ExitMemory(NamedTuple):
    """Scratch memory of the search for an exit."""

    start: Any  # (2, NUMBERS): both motions at the begin of a piece
    now: Any  # (2, NUMBERS): at a time
    quaternion: Any  # (4,)
    row: Any  # (RESULT,): a contact
    motion: Any  # (2,) MOTION


def exit_memory() -> ExitMemory:
    """Make the scratch memory of one thread."""
    return ExitMemory(
        np.zeros((2, NUMBERS)), np.zeros((2, NUMBERS)), np.zeros(4), np.zeros(RESULT), np.zeros(2, MOTION)
    )


class ExitSearch(NamedTuple):
    """Two motions (2, NUMBERS), which hold from 0 to `until`, and what ends a contact of theirs."""

    numbers: Any
    arms: Any  # (m, m): radii about their origins; 0 for a half-space, which does not turn
    tube: Any  # m: how far they may be off their motions, together
    until: Any  # s
    separation: Any  # m
    tolerance: Any  # m


@outlined
def find_exit(
    table: Any, parts: Any, chains: Any, search: ExitSearch, state: Any, memory: ExitMemory, scratch: Any
) -> bool:
    """Whether a gap was found; it is at state[0] + state[1] (s). Until state[2] the contact certainly lasts.

    state (4,): time of the last certain contact, how far beyond it the search looks (s), until when the contact lasts
    (-inf: nothing is certain), and 1 to go on beyond the gap that was found last.
    """
    numbers, now, passes = search.numbers, memory.now, state[3] > 0.0
    t, later, lasts = state[0], state[1], state[2]
    A, B = memory.motion[0], memory.motion[1]
    set_motion(A, numbers, 0)
    set_motion(B, numbers, 1)
    found = False
    for _ in range(STEPS):
        at = t + later
        for side in range(2):
            carry(numbers, side, at, now[side], memory.quaternion)
            quaternion_to_matrix(now[:, 3:7], side, scratch.rotation[side])
        origin = now[0, 0], now[0, 1], now[0, 2]
        p = now[1, 0] - origin[0], now[1, 1] - origin[1], now[1, 2] - origin[2]
        gap, bound = placed_contact(table, parts, chains, origin, p, inf, SURFACES, scratch, memory.row)
        gap, bound = gap - search.separation, bound + search.tube
        if gap - bound > 2.0 * search.tolerance and not passes:
            found = True
            break
        passes = False
        speed, step = _stay(A, B, at, search, -(gap + bound))
        if gap + bound < -0.5 * search.tolerance and step > 0.0:
            t, later = min(at + step, search.until), 0.0
            lasts = t
            if not t < search.until:
                break
            continue
        # as good as apart: look ahead by the time in which they move by the tolerance, then by more and more
        shortest = search.tolerance / speed if speed > 0.0 else search.until
        later = max(2.0 * later, 4.0 * shortest)
        if not t + later < search.until:
            break
    state[0], state[1], state[2] = t, later, lasts
    return found


@inlined
def _stay(A: Any, B: Any, t: float, search: ExitSearch, depth: float) -> tuple[float, float]:
    """How fast points of two motions may part from t on (m/s), and how long (s) a depth (m) lasts."""
    v = relative_velocity(A, B, t)
    turning = most_turning(A, t, search.until) * search.arms[0] + most_turning(B, t, search.until) * search.arms[1]
    speed = sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2]) + turning
    return speed, time_until(depth, speed, 2.0 * half_acceleration(A, B, t, search.until))


@kernel
def exit_of_chains(
    table: ShapeTable, parts: Parts, scratch: Scratch, chains: Any, search: ExitSearch, state: Any, memory: ExitMemory
) -> bool:
    """`find_exit` of two chains of slots."""
    return find_exit(table, parts, chains, search, state, memory, scratch)
