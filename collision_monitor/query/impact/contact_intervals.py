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
from collision_monitor.motion.stated_motion import Motion
from collision_monitor.query.contact.contact import check_kinds, plant_bodies
from collision_monitor.query.contact.contact_kernel import contact_row
from collision_monitor.query.contact.open_gap import location_of
from collision_monitor.query.impact.impact_kernel import first_impact, set_motion
from collision_monitor.query.impact.impact_query import ITERATIONS, MotionQuery, check_query
from collision_monitor.query.impact.moving_body import MovingBody, check_bounded, moving_body
from collision_monitor.query.impact.time_of_impact import time_of_impact
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
    motion_a: Motion,
    shape_b: Compound,
    motion_b: Motion,
    horizon: float = 2.0,
    tolerance: float = 1e-6,
    separation: float = 0.0,
    iterations: int = ITERATIONS,
    most: int = 100,
) -> list[ContactInterval]:
    """All intervals within [0, horizon] (s) in which two shapes are within `separation` (m) of each other.

    The entries are those of `time_of_impact`, from the exit before on. On the way to an exit, an overlap of a depth
    lasts for as long as no point can move by that depth (conservative advancement, Mirtich 1996, from inside). A gap
    that is found to be less than two tolerances (m) ends no contact. most: intervals; the rest is left out. Raises as
    `time_of_impact` does.

    >>> import collision_monitor as cm
    >>> still, swings = cm.Motion(cm.Pose((1, 0, 0))), cm.Motion(cm.Pose(), angular=(0, 0, 3.2))
    >>> found = cm.impacts(cm.Box((3, 0.1, 0.1)), swings, cm.Sphere(0.1), still, horizon=2.0)
    >>> [(round(each.entry[1], 3), round(each.exit[0], 3)) for each in found]
    [(0.0, 0.047), (0.935, 1.029), (1.916, 2.0)]
    """
    query, most = check_query(horizon, tolerance, separation, iterations), checked_whole(most, "most")
    first = time_of_impact(shape_a, motion_a, shape_b, motion_b, *query)
    a, b = moving_body(shape_a, motion_a, "A"), moving_body(shape_b, motion_b, "B")
    check_bounded(a.body, b.body)
    check_kinds(a.body, a.motion.pose, b.body, b.motion.pose)
    plant_bodies(a.body, b.body)
    found: list[ContactInterval] = []
    entry = first.lower, first.upper
    while entry[0] < inf and len(found) < most:
        if entry[1] == inf:
            found.append(ContactInterval(entry, (entry[0], inf)))
            break
        out = _exit(a, b, entry[1], query)
        found.append(ContactInterval(entry, out))
        if not out[1] < query.horizon:
            break
        lower, upper, _ = first_impact(a.body.slots.first, a.motion, b.body.slots.first, b.motion, query, out[1])
        entry = lower, upper
    return found


def _exit(a: MovingBody, b: MovingBody, begin: float, query: MotionQuery) -> tuple[float, float]:
    """Until when the contact lasts that there is at `begin` (s), and a time without it; see ContactInterval."""
    t, horizon, numbers = begin, query.horizon, np.array([[*m.pose.numbers, *m.numbers] for m in (a.motion, b.motion)])
    # a half-space, of infinite radius, does not turn
    arms = np.array([each.body.radius if each.body.radius < inf else 0.0 for each in (a, b)])
    memory, stay = np.zeros(2, MOTION), np.empty(2)
    slots, later = (a.body.slots.first, b.body.slots.first), 0.0
    for _ in range(STEPS):
        now = a.motion.at(t + later), b.motion.at(t + later)
        gap, bound, _ = contact_row(slots[0], now[0], slots[1], now[1], SURFACES)
        gap -= query.separation
        if gap - bound > 2.0 * query.tolerance and not _is_inside(a, b, now):
            return t, t + later
        _stay(memory, numbers, t + later, horizon, arms, -(gap + bound), stay)
        speed, step = stay.tolist()
        if gap + bound < -0.5 * query.tolerance and step > 0.0:
            t, later = t + later + step, 0.0
            if not t < horizon:
                return horizon, inf
            continue
        # as good as apart: look ahead by the time in which they move by the tolerance, then by more and more
        shortest = query.tolerance / speed if speed > 0.0 else horizon
        later = max(2.0 * later, 4.0 * shortest)
        if not t + later < horizon:
            return t, inf
    return t, inf


def _is_inside(a: MovingBody, b: MovingBody, now: tuple[Pose, Pose]) -> bool:
    """Whether one body may be inside the other, whose surface it does not touch: solid meshes alone hide that."""
    if not (a.body.has_mesh or b.body.has_mesh):
        return False
    return any(place != Location.OUTSIDE for place in location_of(a.body, now[0], b.body, now[1]))


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
