"""`impacts`: all intervals of time in which two moving shapes are in contact, with entry and exit."""

from __future__ import annotations

from dataclasses import dataclass
from math import inf
from typing import Any

import numpy as np

from collision_monitor.checks.numbers import checked_whole
from collision_monitor.geometry.point_in_polygon import Location
from collision_monitor.motion.stated_motion import LINEAR, Motion
from collision_monitor.motion.trajectory import Trajectory, carried
from collision_monitor.query.body import QueryBody
from collision_monitor.query.contact.contact_kernel import MEMORY
from collision_monitor.query.contact.open_gap import location_of
from collision_monitor.query.impact.exit_kernel import ExitSearch, exit_memory, exit_of_chains
from collision_monitor.query.impact.impact_query import ITERATIONS, MotionQuery, check_query
from collision_monitor.query.impact.planned_impact import PlannedPair, next_planned_impact, planned_pair
from collision_monitor.query.library import LIBRARY
from collision_monitor.shapes.compound import Compound
from collision_monitor.shapes.pose import Pose


@dataclass(frozen=True)
class ContactInterval:
    """An interval of time (s) in which two shapes are in contact: bounds on its begin and on its end.

    entry: there is no contact before the first, and there is at the second. exit: there is contact until the first, and
    none at the second, which is infinite if the contact lasts to the horizon, or if no later time without it was found.
    An entry with an infinite second time is unresolved: treat it as a contact from the first time on.

    >>> ContactInterval(entry=(0.5, 0.5000001), exit=(0.75, 0.7500002)).exit[0]
    0.75
    """

    entry: tuple[float, float]
    exit: tuple[float, float]


def impacts(
    shape_a: Compound,
    motion_a: Motion | Trajectory,
    shape_b: Compound,
    motion_b: Motion | Trajectory,
    horizon: float = 2.0,
    tolerance: float = 1e-7,
    separation: float = 0.0,
    iterations: int = ITERATIONS,
    most: int = 100,
) -> list[ContactInterval]:
    """All intervals within [0, horizon] (s) in which two shapes are within `separation` (m) of each other.

    The entries are those of `time_of_impact` with this tolerance, from the exit before on. On the way to an exit, an
    overlap of a depth lasts for as long as no point can move by that depth (conservative advancement, Mirtich 1996,
    from inside). A gap that is found to be less than two tolerances (m), and than how far a curve is off its pieces,
    ends no contact. most: intervals; the rest is left out. From where a Trajectory is unknown on, there is an interval
    without an end. Raises as `time_of_impact`.

    >>> import collision_monitor as cm
    >>> still, swings = cm.Motion(cm.Pose((1, 0, 0))), cm.Motion(cm.Pose(), angular=(0, 0, 3.2))
    >>> found = cm.impacts(cm.Box((3, 0.1, 0.1)), swings, cm.Sphere(0.1), still, horizon=2.0)
    >>> [(round(each.entry[1], 3), round(each.exit[0], 3)) for each in found]
    [(0.0, 0.047), (0.935, 1.029), (1.916, 2.0)]
    """
    query, most = check_query(horizon, tolerance, separation, iterations), checked_whole(most, "most")
    pair = planned_pair((shape_a, motion_a), (shape_b, motion_b), query.horizon)
    until = float(pair.pieces.borders[-1])
    found = intervals_from(pair, query, 0.0, most)
    if until < query.horizon and len(found) < most and not (found and found[-1].exit[1] == inf):
        found.append(ContactInterval((until, inf), (until, inf)))
    return found


def intervals_from(pair: PlannedPair, query: MotionQuery, begin: float, most: int) -> list[ContactInterval]:
    """Up to `most` intervals of contact from `begin` (s) on, until the motions end to be known.

    One that is unresolved is the last. The bodies are apart at `begin`, unless it is 0.
    """
    until = float(pair.pieces.borders[-1])
    found: list[ContactInterval] = []
    entry = next_planned_impact(pair, query, begin)
    while entry[0] < inf and len(found) < most:
        if entry[1] == inf:
            found.append(ContactInterval(entry, (entry[0], inf)))
            break
        out = _exit(pair, entry[1], query)
        found.append(ContactInterval(entry, out))
        if not out[1] < until:
            break
        entry = next_planned_impact(pair, query, out[1])
    return found


def _exit(pair: PlannedPair, begin: float, query: MotionQuery) -> tuple[float, float]:
    """Until when the contact lasts that there is at `begin` (s), and a time without it; see ContactInterval."""
    borders, lasts = pair.pieces.borders, begin
    for k in range(pair.piece(begin), len(borders) - 1):
        start = float(borders[k])
        within = query._replace(horizon=float(borders[k + 1]) - start)
        numbers, tube = np.stack([pair.pieces.a[k], pair.pieces.b[k]]), float(pair.pieces.tubes[k].sum())
        stays, apart = _exit_within((pair.a, pair.b), numbers, max(begin - start, 0.0), within, tube)
        lasts = max(lasts, start + stays)
        if apart < inf:
            return lasts, start + apart
    return lasts, inf


def _exit_within(
    pair: tuple[QueryBody, QueryBody], numbers: Any, begin: float, query: MotionQuery, tube: float
) -> tuple[float, float]:
    """`_exit` within one piece of both motions, from `begin` on; the horizon is its end.

    numbers (2, NUMBERS): of both motions. tube (m): how far the bodies may be off the piece. The first time is -inf
    where no contact is certain in the piece.
    """
    a, b = pair
    arms = arm_of(a), arm_of(b)
    search = ExitSearch(numbers, arms, tube, query.horizon, query.separation, query.tolerance)
    state, memory = np.array([begin, 0.0, -inf, 0.0]), exit_memory()
    chains = np.int32(a.slots.first), np.int32(b.slots.first)
    while exit_of_chains(*LIBRARY.tuples, MEMORY.scratch, chains, search, state, memory):
        apart = float(state[0] + state[1])
        if not ((a.has_mesh or b.has_mesh) and _is_inside(a, b, numbers, apart)):
            return float(state[2]), apart
        state[3] = 1.0
    return float(state[2]), inf


def arm_of(body: QueryBody) -> float:
    """Radius (m) about the origin of an object that may turn; 0 for a half-space, which does not."""
    return body.radius if body.radius < inf else 0.0


def _is_inside(a: QueryBody, b: QueryBody, numbers: Any, t: float) -> bool:
    """Whether one body may be inside the other, whose surface it does not touch: solid meshes alone hide that."""
    now = [Pose.of_numbers(row[:LINEAR].tolist()) for row in carried(numbers, np.full(2, t))]
    return any(place != Location.OUTSIDE for place in location_of(a, now[0], b, now[1]))
