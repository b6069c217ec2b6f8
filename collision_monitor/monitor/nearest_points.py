"""The distances of many pairs of bodies, by the monitor's own narrow phase, and the nearest of all bodies to one."""

from __future__ import annotations

from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from collision_monitor._jit import kernel
from collision_monitor.impact.body_contact import RESULT, ContactQuery, body_contact
from collision_monitor.impact.body_impact import CLOSING, Scratch
from collision_monitor.monitor.candidates import filters_of, keep_checked
from collision_monitor.monitor.state.roster import Roster
from collision_monitor.motion.bodies import Multibody
from collision_monitor.motion.extrapolated import extrapolated
from collision_monitor.narrow_phase.contact_row import BOUND, DISTANCE, NORMAL, POINT_A, POINT_B

Array = NDArray[np.float64]
Slots = NDArray[np.int32]

AT_ONCE: Final = 32
"""Bodies whose distances are computed between two looks at the nearest one so far."""


class Nearest(NamedTuple):
    """The nearest points of n pairs.

    found (n,): they are within their limits. distance, error (n,): signed distance and its bound (m). points (n, 2, 3):
    m, in the world. normal (n, 3): unit, from the first to the second. closing (n,): m/s, positive if they approach.
    All are NaN if nothing was found.
    """

    found: NDArray[np.bool_]
    distance: Array
    error: Array
    points: Array
    normal: Array
    closing: Array


class Neighbour(NamedTuple):
    """The object that is nearest to another one, lengths in m and points in the world.

    distance: negative if they overlap. error_bound: its largest error. point: of the other one. other_point: of this.
    """

    object_id: int
    name: str
    distance: float
    error_bound: float
    point: Array
    other_point: Array


def nearest_points_at(
    multibody: Multibody, i: Slots, j: Slots, times: Array, limits: Array, acceleration: float, scratch: Scratch
) -> Nearest:
    """Return the nearest points of the pairs (i, j) (n,) of body slots at `times` (n,) s, up to the limits (n,) m.

    acceleration: m/s^2 that widens the error by what stale bodies may have done since their last states; 0: none.
    """
    results = np.full((len(i), RESULT), np.nan)
    found = np.zeros(len(i), np.bool_)
    _contacts(multibody, i, j, times, limits, acceleration, scratch, results, found)
    results[~found] = np.nan
    points = np.stack([results[:, POINT_A : POINT_A + 3], results[:, POINT_B : POINT_B + 3]], axis=1)
    normal = results[:, NORMAL : NORMAL + 3]
    return Nearest(found, results[:, DISTANCE], results[:, BOUND], points, normal, results[:, CLOSING])


def neighbour_of(roster: Roster, slot: int, now: float, acceleration: float, scratch: Scratch) -> Neighbour | None:
    """Return what is nearest to a body at `now` (s), of the bodies with a state that are checked against it."""
    bodies, top = roster.bodies, roster.top
    others = np.flatnonzero(bodies.used[:top] & bodies.seen[:top]).astype(np.int32)
    others = others[others != slot]
    pairs = np.stack([np.full(len(others), slot, np.int32), others], axis=1)
    pairs = pairs[: keep_checked(*filters_of(bodies), roster.allowed_keys, pairs)]
    others = np.where(pairs[:, 0] == slot, pairs[:, 1], pairs[:, 0])
    if not len(others):
        return None
    there = extrapolated(bodies, np.append(others, slot), now, 0.0).position
    apart = np.sqrt(((there[:-1] - there[-1]) ** 2).sum(axis=1))
    radius = bodies.motion["radius"]
    gaps = apart - radius[others] - radius[slot]  # of the spheres about the bodies
    order = np.argsort(gaps, kind="stable")
    best = Neighbour(-1, "", np.inf, np.nan, np.full(3, np.nan), np.full(3, np.nan))
    for first in range(0, len(order), AT_ONCE):
        part = order[first : first + AT_ONCE]
        if gaps[part[0]] > best.distance:
            break
        which, limits = others[part], np.full(len(part), best.distance)
        mine = np.full(len(part), slot, np.int32)
        near = nearest_points_at(roster.multibody, mine, which, np.full(len(part), now), limits, acceleration, scratch)
        if near.found.any():
            k = int(np.nanargmin(near.distance))
            if near.distance[k] < best.distance:
                other = int(bodies.id[which[k]])
                ends = near.points[k, 1], near.points[k, 0]
                best = Neighbour(other, roster.name(other), float(near.distance[k]), float(near.error[k]), *ends)
    return best if best.object_id >= 0 else None


@kernel
def _contacts(
    multibody: Any, i: Any, j: Any, times: Any, limits: Any, acceleration: float, scratch: Any, results: Any, found: Any
) -> int:
    """Write the deepest contact of each pair into a result row; found: whether it is within its limit (m)."""
    for k in range(i.size):
        query = ContactQuery(limits[k], acceleration)
        touching, _ = body_contact(multibody, i[k], j[k], times[k], query, scratch, results[k])
        found[k] = touching
    return 0
