"""What a report says, as numbers: gathered from a session's history, before anything is drawn."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from collision_monitor.geometry.pose import from_rotation_vector, multiply, rotation_matrix
from collision_monitor.geometry.shape_table import ShapeTableBuilder, take
from collision_monitor.narrow_phase.dispatch import contact_batch
from collision_monitor.narrow_phase.models import Modelled, containing_model
from collision_monitor.records import PredictionStatus
from collision_monitor.session.history import Collision, History, Pair

Floats = NDArray[np.float64]

PIECES: Final = 64
"""Most pairs of convex pieces that a distance is taken of; beyond, the objects' convex hulls stand for them."""

SAMPLES: Final = 600
"""Times at which the distance of a pair is drawn, at most."""


@dataclass(frozen=True)
class Warnings:
    """The predictions of one pair. Times in s; lower, upper: s from then on until they meet."""

    pair: Pair
    time: Floats
    lower: Floats
    upper: Floats
    certain: NDArray[np.bool_]


@dataclass(frozen=True)
class Facts:
    """collisions: all of them. warned: those predicted before they began. surprises: those that were not.

    false: pairs that were predicted to touch before the end, with certainty, and never did. risky: all pairs that
    touched or were predicted to, the riskiest first. quickest: least lead (s) of a warned collision.
    """

    collisions: list[Collision]
    warned: list[Collision]
    surprises: list[Collision]
    possible: list[Collision]
    false: list[Pair]
    risky: list[Pair]
    warnings: dict[Pair, Warnings]
    quickest: float


def gather(history: History) -> Facts:
    """The facts of a history."""
    warnings = _warnings(history)
    certain = [each for each in history.collisions if each.certain]
    touched = {each.pair for each in history.collisions}
    warned = [each for each in certain if each.warned > 0.0]
    return Facts(
        collisions=certain,
        warned=warned,
        surprises=[each for each in certain if each.warned == 0.0],
        possible=[each for each in history.collisions if not each.certain],
        false=[pair for pair, each in warnings.items() if pair not in touched and _came_due(each, history.duration)],
        risky=_riskiest(history, warnings),
        warnings=warnings,
        quickest=min((each.warned for each in warned), default=float("nan")),
    )


def _came_due(each: Warnings, end: float) -> bool:
    """Whether a certain prediction was due before the end."""
    return bool((each.certain & (each.time + each.upper < end)).any())


def _warnings(history: History) -> dict[Pair, Warnings]:
    rows, steps = history.predictions, history.prediction_step
    keys = (rows["id_a"].astype(np.uint64) << np.uint64(32)) | rows["id_b"].astype(np.uint64)
    order = np.lexsort((steps, keys))
    breaks = np.flatnonzero(np.diff(keys[order]) != 0) + 1
    found = {}
    for run in np.split(order, breaks) if len(order) else ():
        pair = (int(rows["id_a"][run[0]]), int(rows["id_b"][run[0]]))
        found[pair] = Warnings(
            pair,
            history.times[steps[run]],
            rows["lower"][run],
            rows["upper"][run],
            rows["status"][run] == PredictionStatus.HIT,
        )
    return found


def _riskiest(history: History, warnings: dict[Pair, Warnings]) -> list[Pair]:
    """Collisions by depth, then predictions by how soon they were due."""
    depth: dict[Pair, float] = {}
    for each in history.collisions:
        depth[each.pair] = min(depth.get(each.pair, np.inf), each.deepest if each.certain else 0.0)
    soonest = {pair: float(each.lower.min()) for pair, each in warnings.items() if pair not in depth}
    return [
        *sorted(depth, key=lambda pair: (depth[pair], pair)),
        *sorted(soonest, key=lambda pair: (soonest[pair], pair)),
    ]


# -- from recorded states


@dataclass(frozen=True)
class Track:
    """States of one object: time (n,) s, position (n, 3) m, quaternion (n, 4), linear (n, 3) m/s, angular (n, 3)."""

    time: Floats
    position: Floats
    quaternion: Floats
    linear: Floats
    angular: Floats

    def at(self, times: Floats) -> tuple[Floats, Floats]:
        """Positions (k, 3) and quaternions (k, 4), each from the last state before, carried on by its twist."""
        i = np.maximum(np.searchsorted(self.time, times, side="right") - 1, 0)
        age = np.maximum(times - self.time[i], 0.0)[:, None]
        turn = from_rotation_vector(self.angular[i] * age)
        return self.position[i] + self.linear[i] * age, multiply(turn, self.quaternion[i])


def track(history: History, object_id: int) -> Track | None:
    """The recorded states of an object, or where it stands; None where nothing usable is known."""
    described = history.objects.get(object_id)
    if described is not None and described.static and described.pose is not None:
        pose, none = described.pose, np.zeros((1, 3))
        return Track(np.zeros(1), pose.position[None], pose.quaternion[None], none, none)
    mine = history.states["id"] == object_id
    rows, time = history.states[mine], history.state_time[mine]
    good = np.isfinite(rows["position"]).all(axis=1)
    good &= np.abs(np.linalg.norm(rows["quaternion"], axis=1) - 1.0) < 1e-3
    good &= np.r_[True, np.diff(time) > 0.0] if len(time) else good
    if not good.any():
        return None
    rows, time = rows[good], time[good]
    twist = [np.where(np.isfinite(rows[name]), rows[name], 0.0) for name in ("linear", "angular")]
    return Track(time, rows["position"].copy(), rows["quaternion"].copy(), *twist)


def pair_distance(history: History, pair: Pair) -> tuple[Floats, Floats]:
    """Times (n,) and signed distances (n,) of two objects, from their recorded states; empty where nothing is known."""
    tracks = [track(history, i) for i in pair]
    a, b = tracks
    if a is None or b is None or any(i not in history.objects for i in pair) or not len(history.times):
        return np.zeros(0), np.zeros(0)
    begin = max(a.time[0], b.time[0])
    times = history.times[history.times >= begin]
    times = times[:: max(len(times) // SAMPLES, 1)]
    models = [containing_model(history.objects[i].shapes, "exact") for i in pair]
    if len(models[0].pieces) * len(models[1].pieces) > PIECES:
        models = [containing_model(history.objects[i].shapes, "convex_hull") for i in pair]
    return times, _distances(models[0], models[1], a.at(times), b.at(times))


def _distances(a: Modelled, b: Modelled, at_a: tuple[Floats, Floats], at_b: tuple[Floats, Floats]) -> Floats:
    count = len(at_a[0])
    R_a, R_b = rotation_matrix(at_a[1]), rotation_matrix(at_b[1])
    builder = ShapeTableBuilder()
    slots = [[builder.append(piece) for piece, _ in model.pieces] for model in (a, b)]
    pairs = np.stack([np.arange(count), np.arange(count, 2 * count)], axis=1).astype(np.int32)
    best = np.full(count, np.inf)
    for slot_a, (_, pose_a) in zip(slots[0], a.pieces, strict=True):
        for slot_b, (_, pose_b) in zip(slots[1], b.pieces, strict=True):
            table = take(builder.table, np.repeat([slot_a, slot_b], count))
            position = np.concatenate([at_a[0] + R_a @ pose_a.position, at_b[0] + R_b @ pose_b.position])
            rotation = np.concatenate([R_a @ pose_a.rotation, R_b @ pose_b.rotation])
            best = np.minimum(best, contact_batch(table, position, rotation, pairs)[:, 0])
    return best
