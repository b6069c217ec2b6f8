"""Prediction of a sphere's next event: a collision with a neighbour or a wall, or the exit from its cell."""

from __future__ import annotations

import math

import numpy as np

from collision_monitor._jit import inlined
from collision_monitor.world.hard_spheres.state import CELL_EXIT, CLOCK, RADIUS, VELOCITY, WALL, State, X


@inlined
def predict(state: State, i: int, now: float) -> float:
    """Store the partner of sphere i's next event after `now` (s), and return the event's time (s).

    Two spheres touch at the smaller root of |r + v t| = R_i + R_j. c / (-b + sqrt(b^2 - a c)) is that root without
    cancellation. Spheres that overlap by round-off and approach touch now.
    """
    spheres, side, per_side = state.spheres, state.side, state.per_side
    vx, vy, vz = spheres[i, VELOCITY], spheres[i, VELOCITY + 1], spheres[i, VELOCITY + 2]
    since = now - spheres[i, CLOCK]
    x, y, z = spheres[i, X] + since * vx, spheres[i, X + 1] + since * vy, spheres[i, X + 2] + since * vz
    radius = spheres[i, RADIUS]
    soonest, partner = np.inf, CELL_EXIT
    low, high = radius, side - radius
    if per_side != 0.0:
        low, high = -np.inf, np.inf
    for axis in range(3):
        speed, centre = spheres[i, VELOCITY + axis], state.centres[i, axis]
        if speed > 0.0:
            wall, end = high, min(centre + state.half_cell, high)
        elif speed < 0.0:
            wall, end = low, max(centre - state.half_cell, low)
        else:
            continue
        after = (end - (spheres[i, X + axis] + since * speed)) / speed
        if after < soonest:
            soonest, partner = after, (WALL - axis if end == wall else CELL_EXIT)
    for m in range(state.counts[i]):
        j = state.neighbours[i, m]
        since = now - spheres[j, CLOCK]
        ux, uy, uz = spheres[j, VELOCITY], spheres[j, VELOCITY + 1], spheres[j, VELOCITY + 2]
        dx = spheres[j, X] + since * ux - x
        dy = spheres[j, X + 1] + since * uy - y
        dz = spheres[j, X + 2] + since * uz - z
        dx -= side * np.rint(dx * per_side)
        dy -= side * np.rint(dy * per_side)
        dz -= side * np.rint(dz * per_side)
        ux, uy, uz = ux - vx, uy - vy, uz - vz
        contact = radius + spheres[j, RADIUS]
        a = ux * ux + uy * uy + uz * uz
        b = dx * ux + dy * uy + dz * uz
        c = dx * dx + dy * dy + dz * dz - contact * contact
        inside = b * b - a * c
        # the root is at least c / (-2 b), so the last condition saves the square root of later collisions
        if (b < 0.0) & (inside > 0.0) & (c < -2.0 * b * soonest):
            after = c / (math.sqrt(inside) - b)
            if after < soonest:
                soonest, partner = after, j
    state.partners[i] = partner
    if partner >= 0:
        state.expected[i] = state.hits[partner]
    return now + max(soonest, 0.0)
