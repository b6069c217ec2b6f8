"""Twists of objects whose messages hold none, from their last poses, with the uncertainty of the estimate.

The velocity is the slope of the line through the positions of a window, by least squares, at the window's end. If each
position has the standard deviation s, that of the slope is s / sqrt(sum (t - mean t)^2). Source: any textbook on linear
regression, such as Draper and Smith, Applied Regression Analysis (1998), 1.4. The angular velocity is that of the
rotation from the first to the last pose of the window.

Poses are kept by time, however many a window holds: beside the newest one, BINS means of the poses of equal parts of
the window. A mean with its number of poses counts as these poses do; only their spread within the bin is lost, which
is 1/BINS^2 of that of the window.
"""

from __future__ import annotations

from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from collision_monitor.records import StateFlag
from collision_monitor.shapes.pose import shortest_turns

Floats = NDArray[np.float64]
States = NDArray[np.void]
Slots = NDArray[np.int64]

BINS: Final = 16
"""Means of poses of each object beside its newest pose."""

_BIN: Final = np.dtype([("first", "i8"), ("time", "f8"), ("count", "f8"), ("position", "f8", 3), ("turn", "f8", 4)])
"""Stamp (ns) and quaternion of the first pose; mean time (s) after it; number of poses; mean position."""

_UNKNOWN: Final = int(StateFlag.TWIST_UNKNOWN)
_NANOSECOND: Final = 1e-9


class TwistEstimator:
    """The last poses of each object, by slot, and the twists estimated from them."""

    def __init__(self) -> None:
        self._bins = np.zeros((0, BINS + 1), _BIN)  # the first one holds the newest pose alone
        self._counts = np.zeros(0, np.int64)
        self._twists = np.zeros((0, 8))  # linear, angular, and their standard deviations
        self._known = np.zeros(0, np.bool_)
        self._windowed = np.zeros(0, np.bool_)

    def grow(self, slots: int) -> None:
        """Make room for so many slots."""
        more = slots - len(self._counts)
        self._bins = np.concatenate([self._bins, np.zeros((more, BINS + 1), _BIN)])
        self._counts = np.append(self._counts, np.zeros(more, np.int64))
        self._twists = np.concatenate([self._twists, np.zeros((more, 8))])
        self._known = np.append(self._known, np.zeros(more, np.bool_))
        self._windowed = np.append(self._windowed, np.zeros(more, np.bool_))

    def forget(self, slot: int) -> None:
        """Forget the poses of a slot."""
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
        newer = (self._counts[slots] == 0) | (stamp_ns > self._bins["first"][slots, 0])
        slots, poses = slots[newer], poses[newer]
        if len(slots) == 0:
            return states
        self._put(slots, poses, stamp_ns, round(window / _NANOSECOND / BINS))
        self._windowed[slots] = window > 0.0
        enough = self._counts[slots] > 1
        slots = slots[enough]
        self._known[slots] = True
        stddevs = poses["position_stddev"][enough], poses["orientation_stddev"][enough]
        self._twists[slots] = _fit(self._bins[slots], self._counts[slots], window, *stddevs)
        return states

    def _put(self, slots: Slots, poses: States, stamp_ns: int, width: int) -> None:
        """Add the newest poses; the ones before join the bin of their time, of `width` ns, or begin one."""
        bins, counts = self._bins[slots], self._counts[slots]
        last, bin_ = bins[:, 0], bins[:, 1]
        joins = (counts > 1) & (last["first"] - bin_["first"] < width)
        number = bin_["count"] + 1.0
        share = np.where(joins, 1.0 / number, 0.0)
        moved = bins.copy()
        moved["time"][:, 1] += share * ((last["first"] - bin_["first"]) * _NANOSECOND - bin_["time"])
        moved["position"][:, 1] += share[:, None] * (last["position"] - bin_["position"])
        moved["count"][joins, 1] = number[joins]
        moved[~joins, 1:] = bins[~joins, :-1]
        newest = moved[:, 0]
        newest["first"], newest["time"], newest["count"] = stamp_ns, 0.0, 1.0
        newest["position"], newest["turn"] = poses["position"], poses["quaternion"]
        self._bins[slots] = moved
        self._counts[slots] = np.where(joins, counts, np.minimum(counts + 1, BINS + 1))

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
    bins: Any, counts: NDArray[np.int64], window: float, position_stddev: Floats, orientation_stddev: Floats
) -> Floats:
    """Return twists (N, 6) and their standard deviations (N, 2) from bins (N, BINS + 1), the newest pose first."""
    times = (bins["first"] - bins["first"][:, :1]) * _NANOSECOND + bins["time"]
    order = np.arange(BINS + 1)
    used = (order < counts[:, None]) & ((times >= -window) | (order < 2))
    weight = np.where(used, bins["count"], 0.0)
    number = weight.sum(1)
    centred = np.where(used, times - (times * weight).sum(1, keepdims=True) / number[:, None], 0.0)
    spread = (weight * centred**2).sum(1)
    relative = np.where(used[:, :, None], bins["position"] - bins["position"][:, :1], 0.0)
    linear = ((weight * centred)[:, :, None] * relative).sum(1) / spread[:, None]
    oldest = used.sum(1) - 1
    rows = np.arange(len(bins))
    elapsed = (bins["first"][:, 0] - bins["first"][rows, oldest]) * _NANOSECOND
    turn, factor = shortest_turns(bins["turn"][rows, oldest], bins["turn"][:, 0])
    angular = turn * (factor / elapsed)[:, None]
    uncertain = position_stddev / np.sqrt(spread), np.sqrt(2.0) * orientation_stddev / elapsed
    return np.column_stack([linear, angular, *uncertain])
