"""The loop: take the earliest event, respond at its exact time, and predict again for the spheres that it changed."""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from collision_monitor._jit import inlined, kernel
from collision_monitor.world.hard_spheres.event_tree import schedule
from collision_monitor.world.hard_spheres.neighbours import move, new_cell
from collision_monitor.world.hard_spheres.next_event import predict
from collision_monitor.world.hard_spheres.state import (
    CELL_EXIT,
    CLOCK,
    COLLISIONS,
    EPOCH,
    LOGGED,
    NOTHING,
    RADIUS,
    VELOCITY,
    VIRIAL,
    WALL,
    WALL_IMPULSE,
    Floats,
    Indices,
    State,
    X,
)

SEPARATION: Final = 1e-13
"""Spheres separate at least at this part of their speeds. With less, round-off could let them approach and collide
again at the same time without end. The energy changes by the square of it."""

EVENTS_PER_CALL: Final = 1_000_000
"""Events of one call of `run_events`: about a second, after which Ctrl-C is noticed."""

DONE, PAUSED, ROWS_FULL, LOG_FULL = range(4)
"""Why `run_events` returned: time reached, number of events reached, a larger `neighbours` or `log` is needed."""


@kernel
def start(state: State) -> bool:
    """Give all spheres their cells, lists and first events; return False if a row of neighbours is full."""
    for i in range(len(state.spheres)):
        if not new_cell(state, i, state.spheres[i, CLOCK]):
            return False
    for i in range(len(state.spheres)):
        schedule(state.times, state.winners, i, predict(state, i, state.spheres[i, CLOCK]))
    return True


@kernel
def run_events(state: State, until: float, events: int, log_times: Floats, log_pairs: Indices) -> int:
    """Process the events up to the time `until` (s since the start), at most `events` of them; return the reason.

    log_times (n,), log_pairs (n, 2): filled with the collisions from row totals[LOGGED] on; n = 0 for no log. A wall
    is -1 - 2 * axis, or one less for the upper wall.
    """
    totals, times = state.totals, state.times
    for _ in range(events):
        i, now = state.winners[1], times[1]
        if not totals[EPOCH] + now <= until:
            return DONE
        if now > state.set_back:
            _set_back(state, math.floor(now / state.set_back) * state.set_back)
            now = times[1]
        j = state.partners[i]
        if j >= 0 and state.hits[j] != state.expected[i]:
            j = NOTHING  # the partner has collided since, so this sphere only needs a new prediction
        if len(log_times) and (j >= 0 or j <= WALL):
            row = int(totals[LOGGED])
            if row == len(log_times):
                return LOG_FULL
            log_times[row], log_pairs[row, 0], log_pairs[row, 1] = totals[EPOCH] + now, i, j
            if j < 0:
                log_pairs[row, 1] = -1 - 2 * (WALL - j) - (state.spheres[i, VELOCITY + WALL - j] > 0.0)
            totals[LOGGED] += 1
        if j >= 0:
            _collide(state, i, j, now)
        elif j <= WALL:
            _bounce(state, i, WALL - j, now)
        elif j == CELL_EXIT and not new_cell(state, i, now):
            return ROWS_FULL
        while i >= 0:
            schedule(times, state.winners, i, predict(state, i, now))
            i, j = j, NOTHING
    return PAUSED


@inlined
def _restitution(state: State, since: float) -> float:
    """Restitution of a collision `since` seconds after one of the same sphere: elastic if that is too short.

    Otherwise infinitely many collisions can happen in a finite time (inelastic collapse). Source: the TC model,
    S. Luding and S. McNamara, Granular Matter 1, 113 (1998).
    """
    return 1.0 if since < state.contact_duration else state.restitution


@inlined
def _collide(state: State, i: int, j: int, now: float) -> None:
    """Exchange momentum along the line of centres.

    The impulse is divided by the distance squared, not by the sum of the radii squared, so that energy is conserved in
    spite of the round-off of the positions.
    """
    move(state, i, now)
    move(state, j, now)
    spheres, side, per_side = state.spheres, state.side, state.per_side
    restitution = _restitution(state, now - max(state.last_hit[i], state.last_hit[j]))
    dx = spheres[j, X] - spheres[i, X]
    dy = spheres[j, X + 1] - spheres[i, X + 1]
    dz = spheres[j, X + 2] - spheres[i, X + 2]
    dx -= side * np.rint(dx * per_side)
    dy -= side * np.rint(dy * per_side)
    dz -= side * np.rint(dz * per_side)
    approach = dx * (spheres[j, VELOCITY] - spheres[i, VELOCITY])
    approach += dy * (spheres[j, VELOCITY + 1] - spheres[i, VELOCITY + 1])
    approach += dz * (spheres[j, VELOCITY + 2] - spheres[i, VELOCITY + 2])
    mass_i, mass_j = state.masses[i], state.masses[j]
    speeds = 0.0
    for axis in range(3):
        speeds += abs(spheres[i, VELOCITY + axis]) + abs(spheres[j, VELOCITY + axis])
    separation = max(-restitution * approach, SEPARATION * speeds * (spheres[i, RADIUS] + spheres[j, RADIUS]))
    change = (approach - separation) / ((dx * dx + dy * dy + dz * dz) * (mass_i + mass_j))
    spheres[i, VELOCITY] += change * mass_j * dx
    spheres[i, VELOCITY + 1] += change * mass_j * dy
    spheres[i, VELOCITY + 2] += change * mass_j * dz
    spheres[j, VELOCITY] -= change * mass_i * dx
    spheres[j, VELOCITY + 1] -= change * mass_i * dy
    spheres[j, VELOCITY + 2] -= change * mass_i * dz
    _count(state, i, now)
    _count(state, j, now)
    state.totals[COLLISIONS] += 1
    state.totals[VIRIAL] += (separation - approach) * mass_i * mass_j / (mass_i + mass_j)


@inlined
def _bounce(state: State, i: int, axis: int, now: float) -> None:
    """Turn the velocity back at a wall."""
    speed, radius = state.spheres[i, VELOCITY + axis], state.spheres[i, RADIUS]
    restitution = _restitution(state, now - state.last_hit[i])
    move(state, i, now)
    state.spheres[i, X + axis] = state.side - radius if speed > 0.0 else radius
    state.spheres[i, VELOCITY + axis] = -restitution * speed
    _count(state, i, now)
    state.totals[WALL_IMPULSE] += (1.0 + restitution) * abs(speed) * state.masses[i]


@inlined
def _count(state: State, i: int, now: float) -> None:
    state.hits[i] += 1
    state.last_hit[i] = now


@inlined
def _set_back(state: State, by: float) -> None:
    """Subtract `by` seconds from all clocks and event times."""
    for i in range(len(state.spheres)):
        state.spheres[i, CLOCK] -= by
        state.last_hit[i] -= by
    for node in range(len(state.times)):
        state.times[node] -= by
    state.totals[EPOCH] += by
