"""The states that arrived since the last step, brought to the step's stamp along their motion."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from collision_monitor import records
from collision_monitor.codec.states import COVARIANCE_SIZE
from collision_monitor.errors import PoseError
from collision_monitor.motion.moved_states import along_body, moved_states
from collision_monitor.records import StateFlag
from collision_monitor.shapes.pose import Pose
from collision_monitor.sources.ground.twist_estimate import TwistEstimator

Floats = NDArray[np.float64]
States = NDArray[np.void]

NANOSECOND: Final = 1e-9
_DIAGONALS: Final = [0, 3, 5], [6, 9, 11]
"""Where the variances are in the 12 numbers of a covariance: of the position, of the velocity."""


class Step(NamedTuple):
    """States of one step, by ascending id. covariance (N, 12), or None if no state has one."""

    stamp_ns: int
    states: States
    covariance: Floats | None


class WaitingStates:
    """The last state of each object, by slot; those that came since the last step wait.

    max_age: s that a state may be older than the step that takes it. too_old: ids of those that were left out because
    they were older, at the last call of `at`.
    """

    def __init__(self, max_age: float) -> None:
        self.too_old: list[int] = []
        self._max_age = max_age
        self._slots: dict[int, int] = {}
        self._free: list[int] = []
        self._twists = TwistEstimator()
        self._states = np.zeros(0, records.STATE)
        self._stamps = np.zeros(0, np.int64)
        self._covariances = np.zeros((0, COVARIANCE_SIZE))
        self._waits = np.zeros(0, np.bool_)
        self._seen = np.zeros(0, np.bool_)  # since the time began
        self._turns = np.zeros(0, np.bool_)

    def put(
        self, states: States, stamp_ns: int, covariance: Floats | None, window: float, *, turns: Any = False
    ) -> None:
        """Store states (N,), each id once, unless a newer one waits. window, turns: as in `SourceScene.observe`."""
        slots = self._slots_of(states["id"].tolist())
        newer = self._waits[slots] & (self._stamps[slots] > stamp_ns)  # two publishers, or messages out of order
        if newer.any():
            slots, states = slots[~newer], states[~newer]
            covariance = None if covariance is None else covariance[~newer]
            turns = np.broadcast_to(turns, len(newer))[~newer]
        self._states[slots] = self._twists.completed(states, slots, stamp_ns, window)
        self._stamps[slots] = stamp_ns
        self._covariances[slots] = np.nan if covariance is None else covariance
        self._waits[slots] = self._seen[slots] = True
        self._turns[slots] = turns

    def state(self, object_id: int, stamp_ns: int) -> Any:
        """Return the state of an object (records.STATE) at a stamp, from its last one; None if missing or too old."""
        slot = self._slots.get(object_id)
        if slot is None or not self._seen[slot]:
            return None
        if abs(stamp_ns - int(self._stamps[slot])) > self._max_age / NANOSECOND:
            return None
        (state,) = self._step(stamp_ns, np.array([slot]), estimated=True).states
        return state

    def pose(self, object_id: int, stamp_ns: int) -> Pose | None:
        """Return the pose of an object at a stamp, from its last state; None if that is missing or too old."""
        state = self.state(object_id, stamp_ns)
        try:
            return None if state is None else Pose(state["position"], state["quaternion"])
        except PoseError:  # it is refused when it reaches the monitor
            return None

    def forget(self, object_id: int) -> None:
        """Forget an object."""
        slot = self._slots.pop(object_id, None)
        if slot is not None:
            self._waits[slot] = self._seen[slot] = False
            self._twists.forget(slot)
            self._free.append(slot)

    def restart(self) -> None:
        """Forget all states."""
        self._waits[:] = self._seen[:] = False
        self._twists.restart()

    def as_stamped(self) -> Iterator[Step]:
        """Yield what waits as one step for each stamp, the oldest first. The twists that are not known stay so."""
        slots = np.flatnonzero(self._waits)
        self._waits[slots] = False
        for stamp in np.unique(self._stamps[slots]).tolist():
            yield self._step(stamp, slots[self._stamps[slots] == stamp], estimated=False)

    def at(self, stamp_ns: int) -> Step:
        """Return what waits, brought to this stamp."""
        slots = np.flatnonzero(self._waits)
        self._waits[slots] = False
        late = stamp_ns - self._stamps[slots] > self._max_age / NANOSECOND
        self.too_old = self._states["id"][slots[late]].tolist() if late.any() else []
        return self._step(stamp_ns, slots[~late], estimated=True)

    def _step(self, stamp_ns: int, slots: NDArray[np.int64], *, estimated: bool) -> Step:
        slots = slots[np.argsort(self._states["id"][slots], kind="stable")]
        states, covariance = self._states[slots], self._covariances[slots]
        self._twists.write(states, slots, everywhere=estimated)
        has_covariance = ~np.isnan(covariance[:, 0])
        elapsed = (stamp_ns - self._stamps[slots]) * NANOSECOND
        if self._turns[slots].any():
            along_body(states, self._turns[slots])
        if elapsed.any():
            states = _advanced(states, covariance, elapsed)
        if not has_covariance.any():
            return Step(stamp_ns, states, None)
        for row in np.flatnonzero(~has_covariance):  # beside one that has, the others need theirs
            covariance[row] = 0.0
            for at, field in zip(_DIAGONALS, ("position_stddev", "velocity_stddev"), strict=True):
                covariance[row, at] = np.nan_to_num(states[field][row]) ** 2
        return Step(stamp_ns, states, covariance)

    def _slots_of(self, ids: list[int]) -> NDArray[np.int64]:
        known = self._slots
        for object_id in ids:
            if object_id not in known:
                known[object_id] = self._free.pop() if self._free else self._grown()
        return np.array([known[object_id] for object_id in ids], np.int64)

    def _grown(self) -> int:
        """Return a new slot. The arrays double when they are full."""
        slot = len(self._slots)
        if slot == len(self._states):
            more = max(16, slot)
            self._states = np.append(self._states, np.zeros(more, records.STATE))
            self._stamps = np.append(self._stamps, np.zeros(more, np.int64))
            self._covariances = np.concatenate([self._covariances, np.full((more, COVARIANCE_SIZE), np.nan)])
            for name in ("_waits", "_seen", "_turns"):
                setattr(self, name, np.append(getattr(self, name), np.zeros(more, np.bool_)))
            self._twists.grow(slot + more)
        return slot


def _advanced(states: Any, covariance: Floats, elapsed: NDArray[Any]) -> Any:
    """Return states (N,) after `elapsed` (N,) s on their courses; widen their uncertainty, also that in covariance."""
    states = moved_states(states, elapsed)
    own = (states["flags"] & StateFlag.BODY_TWIST) != 0  # an error of the heading turns the path
    way = np.where(own, np.linalg.norm(states["linear"], axis=1), 0.0) * elapsed * states["orientation_stddev"]
    speed = np.hypot(states["velocity_stddev"] * elapsed, np.nan_to_num(way))
    states["position_stddev"] = np.hypot(states["position_stddev"], speed)
    states["orientation_stddev"] = np.hypot(states["orientation_stddev"], states["angular_velocity_stddev"] * elapsed)
    covariance[:, :6] += covariance[:, 6:] * elapsed[:, None] ** 2  # of independent errors
    return states
