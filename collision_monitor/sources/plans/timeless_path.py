"""A path without times, and the plan of a robot on it: from where the robot is, as fast as its limits allow."""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

from collision_monitor.geometry.runs import in_runs
from collision_monitor.motion.stated_motion import LINEAR
from collision_monitor.motion.trajectory import Trajectory
from collision_monitor.sources.plans.speed_profile import SpeedLimits, profile_times

Floats = NDArray[np.float64]

SAME_PLACE: Final = 1e-6
"""m: nearer points of a path without times are one. Smaller: a step of round-off gets a speed of its own."""

STEP: Final = 0.1
"""m between points where the speed varies. Between two points it is constant, so that a robot that starts from rest is
off its plan by up to a quarter of this. Smaller: plans of more pieces."""

RAMP: Final = 0.25
"""Largest such distance, in ways that the robot needs from rest to its full speed, and in the rest of the path."""

MOST_STEPS: Final = 20_000
"""Points that are put into a path. A longer one than 2 km has longer steps."""


class TimelessPath:
    """A path in the monitor's frame.

    poses (N, 7), N at least 2, neighbours at different places. stops: the robot stands at its end.
    """

    def __init__(self, poses: Floats, limits: SpeedLimits, *, stops: bool) -> None:
        steps = np.linalg.norm(np.diff(poses[:, :3], axis=0), axis=1)
        self._way = np.append(0.0, np.cumsum(steps))
        self._poses, self._limits, self._stops = poses, limits, stops

    @property
    def length(self) -> float:
        """Length in m."""
        return float(self._way[-1])

    def nearest(self, position: Floats, expected: float, across: float) -> tuple[float, float]:
        """Return the way (m) to the place of the path that is nearest to a position (3,), and how far that is (m).

        Of the places that are nearer than `across`, where a path crosses itself, the one that is nearest to the
        expected way counts.
        """
        begins, steps = self._poses[:-1, :3], np.diff(self._poses[:, :3], axis=0)
        lengths = np.diff(self._way)
        part = np.clip(((position - begins) * steps).sum(axis=1) / np.maximum(lengths, SAME_PLACE) ** 2, 0.0, 1.0)
        off = np.linalg.norm(begins + part[:, None] * steps - position, axis=1)
        near = off <= max(off.min(), across)
        run = np.cumsum(np.append(near[0], near[1:] & ~near[:-1]))  # the number of each stretch that is near
        order = np.lexsort((off, run))
        first = order[near[order]]
        first = first[np.append(True, np.diff(run[first]) > 0)]  # the nearest place of each stretch
        ways = self._way[first] + part[first] * lengths[first]
        k = int(np.argmin(np.abs(ways - expected)))
        return float(ways[k]), float(off[first[k]])

    def plan_from(self, way: float, speed: float) -> tuple[Floats, Floats, Floats]:
        """Return the plan of a robot that is at a way (m, less than the length) with a speed (m/s).

        Its times (M,) from 0 on (s), poses (M, 7) and ways (M,). Raises PoseError for a path that turns too fast.
        """
        ahead = self._way[self._way > way]
        ways = np.append(way, ahead)
        if self._limits.vary:
            ways = _refined(ways, min(STEP, RAMP * min(self._limits.ramp, self.length - way)))
        poses = self._poses
        if len(ways) > len(ahead) + 1 or way > 0.0:
            poses = Trajectory(self._way, poses).rows(ways)[:, :LINEAR]
        return profile_times(ways, poses[:, :3], self._limits, speed, stops=self._stops), poses, ways


def _refined(ways: Floats, step: float) -> Floats:
    """Ways with further ones between them, at most `step` (m) apart, and at least one between the ends."""
    spans = np.diff(ways)
    parts = np.ceil(spans / max(step, (ways[-1] - ways[0]) / MOST_STEPS)).astype(int)
    if parts.sum() < 2:
        parts[0] = 2
    k, nth = in_runs(parts)
    return np.append(ways[k] + nth * (spans / parts)[k], ways[-1])
