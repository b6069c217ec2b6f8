"""First impacts of many pairs of bodies: exact, or bounded by their bounding spheres."""

from __future__ import annotations

from math import inf, isfinite
from typing import Any, Final

import numpy as np

from collision_monitor._jit import inlined, kernel
from collision_monitor._jit.prefetch import prefetch
from collision_monitor._jit.settled import settled
from collision_monitor.impact.body_impact import Window, tube_of
from collision_monitor.impact.coarse_impact import coarse_impact, has_bounds, may_meet
from collision_monitor.impact.impact_record import BOUND_ONLY, CLEAR, UNRESOLVED, write_pair
from collision_monitor.impact.piecewise_impact import body_impact
from collision_monitor.impact.sphere_interval import meeting_of_spheres, relative_motion_at, sphere_interval
from collision_monitor.impact.tree_impact import SearchEnd
from collision_monitor.motion.motion import half_acceleration

WHOLE, BOUNDS, ANEW = range(3)
"""Ways to predict pairs, see `predict_pairs`."""

PREFETCH_AHEAD: Final = 4
"""How many pairs ahead the motions of the bodies are prefetched."""


@inlined
def window_of(bodies: Any, i: int, j: int, now: float) -> Window:
    """Times for which the pair has to be predicted now: from where it was predicted to, until both cover times.

    Empty (begin >= end) if nothing is left to predict.
    """
    begin = max(now, min(bodies.motion[i].covered, bodies.motion[j].covered))
    return Window(begin, cover_of(bodies, i, j))


@inlined
def cover_of(bodies: Any, i: int, j: int) -> float:
    """Time until which both bodies are predicted (s)."""
    return min(bodies.motion[i].cover, bodies.motion[j].cover)


@inlined
def is_cheap(bodies: Any, i: int, j: int) -> bool:
    """Whether an exact search costs no more than a bound: two spheres, or a half-space (it has no bounding sphere)."""
    spheres = bodies.spin_radius[i] == 0.0 and bodies.spin_radius[j] == 0.0
    return spheres or not (isfinite(bodies.motion[i].radius) and isfinite(bodies.motion[j].radius))


@inlined
def bound_impact(bodies: Any, i: int, j: int, window: Window, margin: float, event: Any) -> None:
    """Write the first time in the window at which the pair's bounding spheres meet into the IMPACT record `event`.

    event.status = UNRESOLVED, or CLEAR if the spheres, and therefore the bodies, do not meet. That of a body with a
    plan is followed to the end of the piece that holds now, from where on the pair may meet.
    """
    begin, end = window
    if bodies.id[i] > bodies.id[j]:
        i, j = j, i
    A, B = bodies.motion[i], bodies.motion[j]
    event.status = CLEAR
    stop = min(A.until, B.until)
    if stop < end:  # until the next piece of a plan, which may lead anywhere
        end = max(begin, stop)
    tube = tube_of(A, B, begin)
    approach = relative_motion_at(A, B, begin)
    bent = half_acceleration(A, B, begin, end) * (end - begin)
    reach = A.radius + B.radius + margin + tube.start
    first, last = sphere_interval(approach.p, approach.v, reach, tube.growth + bent, end - begin, 1.0)
    if first > last:
        if end == window.end:
            return
        first = end - begin
    write_pair(bodies, i, j, event)
    event.shape_i, event.shape_j = bodies.first_shape[i], bodies.first_shape[j]
    event.lower, event.upper = begin + first, inf
    event.status, event.method = UNRESOLVED, BOUND_ONLY
    meeting_of_spheres(A, B, approach, begin, first, event)


@settled
@kernel
def predict_pairs(
    multibody: Any, pairs: Any, now: float, query: Any, ending: SearchEnd, how: int, events: Any, scratch: Any
) -> tuple[int, int]:
    """Write the first impacts of pairs (P, 2) until both bodies' cover times into events (IMPACT).

    The search begins at `now`, or at the time until which the pair was predicted before. how: WHOLE; BOUNDS, where only
    the bounding spheres of pairs that are not cheap are compared; ANEW, where it begins at `now`. ending: when the
    search for the impact of a mesh ends early. Returns (number of impacts, number of distance queries).
    """
    bodies = multibody.bodies
    n = queries = 0
    for k in range(pairs.shape[0]):
        ahead = min(k + PREFETCH_AHEAD, pairs.shape[0] - 1)
        prefetch(bodies.motion, np.intp(pairs[ahead, 0]))
        prefetch(bodies.motion, np.intp(pairs[ahead, 1]))
        i, j = pairs[k, 0], pairs[k, 1]
        window = Window(now, cover_of(bodies, i, j)) if how == ANEW else window_of(bodies, i, j, now)
        if how != ANEW and window.begin > now and window.begin >= window.end:
            continue
        is_known = False
        if how == BOUNDS and not is_cheap(bodies, i, j):
            is_known = True
            bound_impact(bodies, i, j, window, query.margin, events[n])
        elif ending.tolerance > 0.0 and has_bounds(multibody, i, j):
            if not may_meet(bodies.motion[i], bodies.motion[j], window, query.margin):
                continue
            queries += 1
            is_known = coarse_impact(multibody, i, j, window, query, ending, scratch, events[n])
        if not is_known:
            queries += body_impact(multibody, i, j, window, query, scratch, events[n])
        if events[n].status != CLEAR:
            n += 1
    return n, queries
