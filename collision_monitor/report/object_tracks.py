"""Positions and distances of objects, computed from the recorded states."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from collision_monitor.motion.moved_states import moved_states
from collision_monitor.narrow_phase.dispatch import contact_batch
from collision_monitor.objects.models import Modelled, containing_model
from collision_monitor.records import STATE, StateFlag
from collision_monitor.session.history.history import Floats, History, Pair
from collision_monitor.shapes.pose import rotation_matrix
from collision_monitor.shapes.shape_table import ShapeTableBuilder, take

MOST_PIECE_PAIRS: Final = 64
"""Largest number of pairs of convex pieces for a distance. Beyond it, the convex hulls replace the objects."""

MOST_TIMES: Final = 800
"""Largest number of times at which the distance of a pair is computed."""


@dataclass(frozen=True, eq=False)
class ObjectTrack:
    """States (n,) of records.STATE of one object, with their times (n,) s.

    jump (n,): the object jumped to this state and did not move from the state before. A static object has one state,
    with time -inf.
    """

    time: Floats
    states: Any
    jump: NDArray[np.bool_]

    def at(self, times: Floats) -> tuple[Floats, Floats, Floats]:
        """Return positions (k, 3) and quaternions (k, 4), extrapolated from the last state, and its age (k,) s.

        The age is NaN before the first state, and 0 for a static object.
        """
        i = np.searchsorted(self.time, times, side="right") - 1
        with np.errstate(invalid="ignore"):
            age = np.where(i >= 0, times - self.time[np.maximum(i, 0)], np.nan)
        moved = moved_states(self.states[np.maximum(i, 0)], np.nan_to_num(age, posinf=0.0))
        return moved["position"], moved["quaternion"], np.where(np.isposinf(age), 0.0, age)


class Tracks:
    """Tracks of the objects of a history, by id."""

    def __init__(self, history: History) -> None:
        self._history = history
        self._order = np.argsort(history.states["id"], kind="stable")
        self._ids = history.states["id"][self._order]
        self._found: dict[int, ObjectTrack | None] = {}

    def __getitem__(self, object_id: int) -> ObjectTrack | None:
        """Return the track of an object, or None if it has no usable state."""
        if object_id not in self._found:
            self._found[object_id] = self._read(object_id)
        return self._found[object_id]

    def _read(self, object_id: int) -> ObjectTrack | None:
        described = self._history.objects.get(object_id)
        if described is not None and described.static and described.pose is not None:
            stands: Any = np.zeros(1, STATE)
            stands["position"], stands["quaternion"] = described.pose.position, described.pose.quaternion
            return ObjectTrack(np.array([-np.inf]), stands, np.zeros(1, np.bool_))
        low, high = np.searchsorted(self._ids, [object_id, object_id + 1])
        mine = self._order[low:high]
        rows, time = self._history.states[mine], self._history.state_time[mine]
        good = np.isfinite(rows["position"]).all(axis=1)
        good &= np.abs(np.linalg.norm(rows["quaternion"], axis=1) - 1.0) < 1e-3
        good[1:] &= time[1:] > np.maximum.accumulate(time)[:-1]
        if not good.any():
            return None
        rows, time = rows[good], time[good]
        for name in ("linear", "angular", "acceleration"):
            rows[name] = np.where(np.isfinite(rows[name]), rows[name], 0.0)
        return ObjectTrack(time, rows, (rows["flags"] & StateFlag.DISCONTINUITY) != 0)

    def distance(self, pair: Pair) -> tuple[Floats, Floats] | None:
        """Return times (n,) and signed distances (n,) in m, NaN without a recent state. None if nothing is known."""
        history, (a, b) = self._history, (self[object_id] for object_id in pair)
        if a is None or b is None or any(i not in history.objects for i in pair) or not len(history.times):
            return None
        times = history.times[:: -(-len(history.times) // MOST_TIMES)]
        at_a, at_b = a.at(times), b.at(times)
        models = [containing_model(history.objects[i].shapes, "exact") for i in pair]
        if len(models[0].pieces) * len(models[1].pieces) > MOST_PIECE_PAIRS:
            models = [containing_model(history.objects[i].shapes, "convex_hull") for i in pair]
        distance = _distances(models[0], models[1], at_a[:2], at_b[:2])
        distance -= sum(history.objects[i].padding for i in pair)
        oldest = history.profile.stale_after
        distance[~((at_a[2] <= oldest) & (at_b[2] <= oldest))] = np.nan
        jumps = np.searchsorted(times, np.concatenate([each.time[each.jump] for each in (a, b)]))
        jumps = np.unique(jumps[(jumps > 0) & (jumps < len(times))])
        return np.insert(times, jumps, times[jumps]), np.insert(distance, jumps, np.nan)  # breaks the line at a jump


def _distances(a: Modelled, b: Modelled, at_a: tuple[Floats, Floats], at_b: tuple[Floats, Floats]) -> Floats:
    """Smallest signed distances (n,) of the pieces of two objects at these positions and quaternions."""
    count = len(at_a[0])
    R_WA, R_WB = rotation_matrix(at_a[1]), rotation_matrix(at_b[1])
    builder = ShapeTableBuilder()
    slots = [[builder.append(piece) for piece, _ in model.pieces] for model in (a, b)]
    pairs = np.stack([np.arange(count), np.arange(count, 2 * count)], axis=1).astype(np.int32)
    best = np.full(count, np.inf)
    for slot_a, (_, pose_a) in zip(slots[0], a.pieces, strict=True):
        for slot_b, (_, pose_b) in zip(slots[1], b.pieces, strict=True):
            table = take(builder.table, np.repeat([slot_a, slot_b], count))
            position = np.concatenate([at_a[0] + R_WA @ pose_a.position, at_b[0] + R_WB @ pose_b.position])
            rotation = np.concatenate([R_WA @ pose_a.rotation, R_WB @ pose_b.rotation])
            best = np.minimum(best, contact_batch(table, position, rotation, pairs)[:, 0])
    return best
