"""Twists of objects whose messages hold none, from their last poses, with the uncertainty of the estimate.

The velocity is the slope of the line through the positions of a window, by least squares, at the window's end. If each
position has the standard deviation s, that of the slope is s / sqrt(sum (t - mean t)^2). Source: any textbook on linear
regression, such as Draper and Smith, Applied Regression Analysis (1998), 1.4. The angular velocity is that of the
rotation from the first to the last pose of the window.
"""

from __future__ import annotations

from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from collision_monitor.records import StateFlag
from collision_monitor.shapes.pose import multiply

Floats = NDArray[np.float64]
States = NDArray[np.void]
Slots = NDArray[np.int64]

SAMPLES: Final = 16
"""Poses of each object that are kept."""

_UNKNOWN: Final = int(StateFlag.TWIST_UNKNOWN)
_NANOSECOND: Final = 1e-9


class TwistEstimator:
    """The last poses of each object, by slot, and the twists estimated from them."""

    def __init__(self) -> None:
        self._stamps = np.zeros((0, SAMPLES), np.int64)
        self._poses = np.zeros((0, SAMPLES, 7))
        self._counts = np.zeros(0, np.int64)
        self._twists = np.zeros((0, 8))  # linear, angular, and their standard deviations
        self._known = np.zeros(0, np.bool_)
        self._windowed = np.zeros(0, np.bool_)

    def grow(self, slots: int) -> None:
        """Make room for so many slots."""
        more = slots - len(self._counts)
        self._stamps = np.concatenate([self._stamps, np.zeros((more, SAMPLES), np.int64)])
        self._poses = np.concatenate([self._poses, np.zeros((more, SAMPLES, 7))])
        self._counts = np.append(self._counts, np.zeros(more, np.int64))
        self._twists = np.concatenate([self._twists, np.zeros((more, 8))])
        self._known = np.append(self._known, np.zeros(more, np.bool_))
        self._windowed = np.append(self._windowed, np.zeros(more, np.bool_))

    def forget(self, slot: int) -> None:
        """Forget the poses of an object."""
        self._counts[slot], self._known[slot] = 0, False

    def restart(self) -> None:
        """Forget all poses."""
        self._counts[:], self._known[:] = 0, False

    def completed(self, states: States, slots: Slots, stamp_ns: int, window: float) -> States:
        """Take over the poses of states with TWIST_UNKNOWN and estimate their twists. Return the states."""
        unknown = (states["flags"] & _UNKNOWN) != 0
        self._known[slots[~unknown]] = False
        usable = unknown & np.isfinite(states["position"]).all(1) & np.isfinite(states["quaternion"]).all(1)
        slots, poses = slots[usable], states[usable]
        newer = (self._counts[slots] == 0) | (stamp_ns > self._stamps[slots, 0])
        slots, poses = slots[newer], poses[newer]
        if len(slots) == 0:
            return states
        self._stamps[slots, 1:], self._poses[slots, 1:] = self._stamps[slots, :-1], self._poses[slots, :-1]
        self._stamps[slots, 0] = stamp_ns
        self._poses[slots, 0] = np.concatenate([poses["position"], poses["quaternion"]], axis=1)
        self._counts[slots] = np.minimum(self._counts[slots] + 1, SAMPLES)
        self._windowed[slots] = window > 0.0
        enough = self._counts[slots] > 1
        slots = slots[enough]
        self._known[slots] = True
        stddevs = poses["position_stddev"][enough], poses["orientation_stddev"][enough]
        self._twists[slots] = _fit(self._stamps[slots], self._poses[slots], self._counts[slots], window, *stddevs)
        return states

    def write(self, states: Any, slots: Slots, *, everywhere: bool) -> None:
        """Write the estimated twists into states; only those over a window unless `everywhere`."""
        estimated = self._known[slots] & ((states["flags"] & _UNKNOWN) != 0)
        if not everywhere:
            estimated &= self._windowed[slots]
        if not estimated.any():
            return
        twists = self._twists[slots[estimated]]
        for field, columns in (("linear", slice(0, 3)), ("angular", slice(3, 6))):
            states[field][estimated] = twists[:, columns]
        states["velocity_stddev"][estimated], states["angular_velocity_stddev"][estimated] = twists[:, 6], twists[:, 7]
        states["flags"][estimated] &= ~np.uint32(_UNKNOWN)


def _fit(
    stamps: NDArray[np.int64],
    poses: Floats,
    counts: NDArray[np.int64],
    window: float,
    position_stddev: Floats,
    orientation_stddev: Floats,
) -> Floats:
    """Return twists (N, 6) and their standard deviations (N, 2) from poses (N, SAMPLES, 7), the newest first."""
    times = (stamps - stamps[:, :1]) * _NANOSECOND
    order = np.arange(SAMPLES)
    used = (order < counts[:, None]) & ((times >= -window) | (order < 2))
    number = used.sum(1)
    centred = np.where(used, times - (times * used).sum(1, keepdims=True) / number[:, None], 0.0)
    spread = (centred**2).sum(1)
    relative = poses[:, :, :3] - poses[:, :1, :3]
    linear = (centred[:, :, None] * np.where(used[:, :, None], relative, 0.0)).sum(1) / spread[:, None]
    oldest = number - 1
    rows = np.arange(len(poses))
    elapsed = -times[rows, oldest]
    turn = multiply(poses[:, 0, 3:], poses[rows, oldest, 3:] * (-1.0, -1.0, -1.0, 1.0))
    turn *= np.where(turn[:, 3:] < 0.0, -1.0, 1.0)
    sine = np.sqrt((turn[:, :3] ** 2).sum(1))
    rate = np.where(sine > 0.0, 2.0 * np.arctan2(sine, turn[:, 3]) / np.where(sine > 0.0, sine, 1.0), 2.0) / elapsed
    angular = turn[:, :3] * rate[:, None]
    uncertain = position_stddev / np.sqrt(spread), np.sqrt(2.0) * orientation_stddev / elapsed
    return np.column_stack([linear, angular, *uncertain])
