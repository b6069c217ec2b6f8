"""Pairs of uncertain bodies whose bounding spheres, grown by their uncertainty, could meet: the first, cheap test."""

from __future__ import annotations

from math import inf
from typing import NamedTuple

from collision_monitor._jit import inlined, kernel
from collision_monitor.prediction.body_contact import relative_now
from collision_monitor.prediction.sphere_interval import sphere_interval
from collision_monitor.prediction.spread import is_uncertain, surface_spread


class Nearness(NamedTuple):
    """What counts as near."""

    sigmas: float  # standard deviations by which the spheres grow
    margin: float  # m
    horizon: float  # s
    stale_acceleration: float  # m/s^2


@kernel
def find_near(bodies, spread, entries, now, nearness, found):
    """Write the indices of the entries (n,) whose bodies could meet within the horizon into found (n,).

    entries: records with the body slots i and j. Pairs without uncertainty are left out. Returns their number.
    """
    count = 0
    for k in range(entries.size):
        i, j = entries[k].i, entries[k].j
        if (is_uncertain(spread, i) or is_uncertain(spread, j)) and _could_meet(bodies, spread, i, j, now, nearness):
            found[count] = k
            count += 1
    return count


@inlined
def _could_meet(bodies, spread, i, j, now, nearness):
    """Whether the grown bounding spheres of bodies i and j meet. Accelerations count as growth."""
    sigmas, margin, horizon, stale_acceleration = nearness
    reach = bodies.motion[i].radius + bodies.motion[j].radius + margin
    if not reach < inf:
        return True
    p, v, age_i, age_j = relative_now(bodies, i, j, now)
    start_i, growth_i = surface_spread(spread, i, bodies.spin_radius[i], age_i, horizon, stale_acceleration)
    start_j, growth_j = surface_spread(spread, j, bodies.spin_radius[j], age_j, horizon, stale_acceleration)
    bent = 0.0
    for c in range(3):
        bent += abs(bodies.acceleration[j, c] - bodies.acceleration[i, c])
    growth = sigmas * (growth_i + growth_j) + 0.5 * bent * horizon
    return sphere_interval(p, v, reach + sigmas * (start_i + start_j), growth, horizon, 1.0)[0] < inf
