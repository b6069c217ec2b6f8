"""Pairs of uncertain bodies whose bounding spheres, grown by their uncertainty, could meet: the first, cheap test.

A static box, as most racks and walls are, also has the planes of its faces. The sphere of a long one holds much of the
room beside it.
"""

from __future__ import annotations

from math import inf
from typing import Any, NamedTuple

from collision_monitor._jit import device, inlined, kernel
from collision_monitor.impact.body_contact import relative_now
from collision_monitor.impact.sphere_interval import sphere_interval
from collision_monitor.motion.course import STRAIGHT
from collision_monitor.motion.last_state import bending_now
from collision_monitor.shapes.kinds.box import BOX
from collision_monitor.uncertainty.spread import is_uncertain, surface_spread, swing_radius


class NearPairRange(NamedTuple):
    """What counts as near."""

    sigmas: float  # standard deviations by which the spheres grow
    margin: float  # m
    horizon: float  # s
    stale_acceleration: float  # m/s^2


@kernel
def find_near(multibody: Any, spread: Any, entries: Any, now: float, nearness: NearPairRange, found: Any) -> int:
    """Write the indices of the entries (n,) whose bodies could meet within the horizon into found (n,).

    entries: records with the body slots i and j. Pairs without uncertainty are left out. Returns their number.
    """
    count = 0
    for k in range(entries.size):
        i, j = entries[k].i, entries[k].j
        if (is_uncertain(spread, i) or is_uncertain(spread, j)) and _could_meet(multibody, spread, i, j, now, nearness):
            found[count] = k
            count += 1
    return count


@inlined
def _could_meet(multibody: Any, spread: Any, i: int, j: int, now: float, nearness: NearPairRange) -> bool:
    """Whether the grown bounding spheres of bodies i and j meet. Accelerations count as growth. Plans lead anywhere."""
    table, parts, bodies = multibody
    if bodies.planned[i] or bodies.planned[j]:
        return True
    sigmas, margin, horizon, stale_acceleration = nearness
    reach = bodies.motion[i].radius + bodies.motion[j].radius + margin
    if not reach < inf:
        return True
    p, v, age_i, age_j, _, _ = relative_now(bodies, i, j, now)
    r_i, r_j = swing_radius(bodies, spread, i), swing_radius(bodies, spread, j)
    start_i, growth_i = surface_spread(bodies, spread, i, r_i, age_i, horizon, stale_acceleration)
    start_j, growth_j = surface_spread(bodies, spread, j, r_j, age_j, horizon, stale_acceleration)
    bent = 0.0
    if bodies.course[i] == STRAIGHT and bodies.course[j] == STRAIGHT:
        for c in range(3):
            bent += abs(bodies.acceleration[j, c] - bodies.acceleration[i, c])
    else:
        bent = bending_now(bodies, i, age_i, horizon) + bending_now(bodies, j, age_j, horizon)
    start, growth = sigmas * (start_i + start_j), sigmas * (growth_i + growth_j) + 0.5 * bent * horizon
    if sphere_interval(p, v, reach + start, growth, horizon, 1.0)[0] == inf:
        return False
    way = (p, v, margin + start, margin + start + growth * horizon, horizon)
    return not (
        _stays_beside(table, parts, bodies, i, bodies.motion[j].radius, way)
        or _stays_beside(table, parts, bodies, j, bodies.motion[i].radius, way)
    )


@device
def _stays_beside(table: Any, parts: Any, bodies: Any, i: int, radius: float, way: Any) -> bool:
    """Whether one face of body i, a static box, keeps a sphere of this radius (m) away.

    way: relative position (m) and velocity (m/s) of the bodies' origins, the distance (m) that does not suffice now and
    at the horizon, and the horizon (s). The gap along a face is a straight line of time.
    """
    s = bodies.first_shape[i]
    if not bodies.static[i] or table.kind[s] != BOX or parts.next[s] >= 0 or parts.placed[s]:
        return False
    p, v, begin, end, horizon = way
    R = bodies.motion[i].rotation
    for k in range(3):
        now = R[0, k] * p[0] + R[1, k] * p[1] + R[2, k] * p[2]
        then = now + horizon * (R[0, k] * v[0] + R[1, k] * v[1] + R[2, k] * v[2])
        reach = table.size[s, k] + table.margin[s] + radius
        if (now > reach + begin and then > reach + end) or (now < -reach - begin and then < -reach - end):
            return True
    return False
