"""`impacts`: all intervals of time in which two moving shapes are in contact, with entry and exit."""

from __future__ import annotations

from dataclasses import dataclass
from math import inf, sqrt
from typing import Any, Final

import numpy as np

from collision_monitor._jit import kernel
from collision_monitor.checks.numbers import checked_whole
from collision_monitor.geometry.point_in_polygon import Location
from collision_monitor.impact.mesh_pair import SURFACES
from collision_monitor.meshes.advance.approach import time_until
from collision_monitor.motion.motion import MOTION, half_acceleration, most_turning, relative_velocity
from collision_monitor.motion.stated_motion import LINEAR, Motion
from collision_monitor.motion.trajectory import Trajectory, carried
from collision_monitor.query.body import QueryBody
from collision_monitor.query.contact.contact_kernel import contact_row
from collision_monitor.query.contact.open_gap import location_of
from collision_monitor.query.impact.impact_kernel import set_motion
from collision_monitor.query.impact.impact_query import ITERATIONS, MotionQuery, check_query
from collision_monitor.query.impact.planned_impact import PlannedPair, next_planned_impact, planned_pair
from collision_monitor.shapes.compound import Compound
from collision_monitor.shapes.pose import Pose

STEPS: Final = 400
"""Most contacts that are computed on the way to an exit. Each step takes the share of the overlap that the body would
leave if all its points moved the same way; more steps follow slower exits."""


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
    found: list[ContactInterval] = []
    entry = next_planned_impact(pair, query, 0.0)
    while entry[0] < inf and len(found) < most:
        if entry[1] == inf:
            found.append(ContactInterval(entry, (entry[0], inf)))
            break
        out = _exit(pair, entry[1], query)
        found.append(ContactInterval(entry, out))
        if not out[1] < until:
            break
        entry = next_planned_impact(pair, query, out[1])
    if until < query.horizon and len(found) < most and not (found and found[-1].exit[1] == inf):
        found.append(ContactInterval((until, inf), (until, inf)))
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
    lasts = -inf
    t, horizon = begin, query.horizon
    # a half-space, of infinite radius, does not turn
    arms = np.array([each.radius if each.radius < inf else 0.0 for each in (a, b)])
    memory, stay = np.zeros(2, MOTION), np.empty(2)
    slots, later = (a.slots.first, b.slots.first), 0.0
    for _ in range(STEPS):
        now = [Pose.of_numbers(row[:LINEAR].tolist()) for row in carried(numbers, np.full(2, t + later))]
        gap, bound, _ = contact_row(slots[0], now[0], slots[1], now[1], SURFACES)
        gap, bound = gap - query.separation, bound + tube
        if gap - bound > 2.0 * query.tolerance and not _is_inside(a, b, now):
            return lasts, t + later
        _stay(memory, numbers, t + later, horizon, arms, -(gap + bound), stay)
        speed, step = stay.tolist()
        if gap + bound < -0.5 * query.tolerance and step > 0.0:
            lasts, later = min(t + later + step, horizon), 0.0
            t = lasts
            if not t < horizon:
                break
            continue
        # as good as apart: look ahead by the time in which they move by the tolerance, then by more and more
        shortest = query.tolerance / speed if speed > 0.0 else horizon
        later = max(2.0 * later, 4.0 * shortest)
        if not t + later < horizon:
            break
    return lasts, inf


def _is_inside(a: QueryBody, b: QueryBody, now: list[Pose]) -> bool:
    """Whether one body may be inside the other, whose surface it does not touch: solid meshes alone hide that."""
    if not (a.has_mesh or b.has_mesh):
        return False
    return any(place != Location.OUTSIDE for place in location_of(a, now[0], b, now[1]))


@kernel
def _stay(motion: Any, numbers: Any, t: float, until: float, arms: Any, depth: float, stay: Any) -> None:
    """Write how fast points of two motions may part from t on (m/s), and how long (s) a depth (m) lasts, to stay (2,).

    numbers (2, NUMBERS): of both motions; motion (2,) MOTION: memory. arms (2,): radii (m) about their origins.
    """
    A, B = motion[0], motion[1]
    set_motion(A, numbers, 0)
    set_motion(B, numbers, 1)
    v = relative_velocity(A, B, t)
    turning = most_turning(A, t, until) * arms[0] + most_turning(B, t, until) * arms[1]
    stay[0] = sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2]) + turning
    stay[1] = time_until(depth, stay[0], 2.0 * half_acceleration(A, B, t, until))
