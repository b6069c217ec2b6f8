"""Pairs that a rule leaves out because they rest or move apart, for each of its thresholds by itself.

Each threshold is judged without regard to the others, so a further threshold or rule never lowers a level. What rests
or parts now says nothing about a collision that comes: an object starts, turns, or falls back. So a threshold on what
comes leaves out only what rests throughout the horizon, and never a certain impact.
"""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

from collision_monitor.alerts.answered import is_touching
from collision_monitor.alerts.measures import Measures
from collision_monitor.alerts.monitored_bodies import MonitoredBodies
from collision_monitor.alerts.rules import Rule
from collision_monitor.alerts.thresholds import APPROACH, FROM_ANSWERS

REST_SPEED: Final = 0.05
"""m/s: two bodies none of whose points is faster rest. Trackers report about this for people who stand."""

PARTING_SPEED: Final = 0.05
"""m/s: a pair whose nearest points move apart faster than this parts."""

Mask = NDArray[np.bool_]


def quiet_pairs(rule: Rule, scene: MonitoredBodies, found: Measures) -> dict[str, Mask]:
    """Return by measure which pairs (n,) the rule's threshold on it leaves out. What is uncertain is never left out."""
    nothing = np.zeros(len(found), np.bool_)
    parts = (found["closing_speed"] < -PARTING_SPEED) & ~is_touching(found) if rule.quiet_when_parting else nothing
    rests = _rest(scene.speed, found) if rule.quiet_at_rest else nothing
    stays = _rest(scene.speed_within(scene.profile.horizon), found) if rule.quiet_at_rest else nothing
    now = (rests | parts) & ~found.uncertain
    coming = stays & ~found.uncertain & ~found.is_certain_hit
    is_nearest_now = found[APPROACH[1]] == 0.0  # the distance only grows
    closest = (stays | (parts & is_nearest_now)) & ~found.uncertain & ~found.is_certain_hit
    quiet = dict.fromkeys(rule.measures, now)
    return {**quiet, **dict.fromkeys(FROM_ANSWERS, coming), **dict.fromkeys(APPROACH, closest)}


def _rest(speed: NDArray[np.float64], found: Measures) -> Mask:
    return np.asarray((speed[found.i] <= REST_SPEED) & (speed[found.j] <= REST_SPEED))
