"""The distances of many pairs of bodies, by the monitor's own narrow phase."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from collision_monitor._jit import kernel
from collision_monitor.alerts.measures import Array, Slots
from collision_monitor.alerts.monitored_bodies import MonitoredBodies
from collision_monitor.impact.body_contact import RESULT, ContactQuery, body_contact
from collision_monitor.impact.body_impact import CLOSING
from collision_monitor.narrow_phase.contact_row import BOUND, DISTANCE, NORMAL, POINT_A, POINT_B


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


def nearest_points_at(
    scene: MonitoredBodies, i: Slots, j: Slots, times: Array, limits: Array, *, widen: bool
) -> Nearest:
    """Return the nearest points of the pairs (i, j) (n,) at `times` (n,) s, up to the limits (n,) m.

    widen: whether the error includes what stale bodies may have done since their last states.
    """
    results = np.full((len(i), RESULT), np.nan)
    found = np.zeros(len(i), np.bool_)
    acceleration = scene.profile.stale_acceleration if widen else 0.0
    _contacts(scene.roster.multibody, i, j, times, limits, acceleration, scene.scratch, results, found)
    results[~found] = np.nan
    points = np.stack([results[:, POINT_A : POINT_A + 3], results[:, POINT_B : POINT_B + 3]], axis=1)
    normal = results[:, NORMAL : NORMAL + 3]
    return Nearest(found, results[:, DISTANCE], results[:, BOUND], points, normal, results[:, CLOSING])


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
