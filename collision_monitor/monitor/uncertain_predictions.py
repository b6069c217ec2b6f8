"""What declared uncertainty adds to the predictions of a step: when and how likely, and pairs that may meet after all.

Pairs whose stated motions pass each other are kept in a list like the event list: an entry holds as long as the
motions of both bodies do. Nothing here runs before a state declares an uncertainty.
"""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from functools import lru_cache
from math import inf, nan
from statistics import NormalDist
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from collision_monitor._jit import kernel
from collision_monitor.objects.description import ObjectDescription
from collision_monitor.prediction.acceleration_bounds import widen_intervals
from collision_monitor.prediction.motion import Bodies, enlarge
from collision_monitor.prediction.normal_samples import normal_samples
from collision_monitor.prediction.spread import is_uncertain, make_spread, take_spread
from collision_monitor.prediction.uncertainty import PROBABILITY, Room, impact_probabilities, make_room
from collision_monitor.records import PREDICTION, Method, PredictionStatus

ANSWERS: Final = ("earliest", "most_likely", "latest", "probability")
FEWEST_PAIRS_FOR_THREADS: Final = 8
"""Handing work to a thread costs as much as some of them."""

INTERVAL: Final = ("lower", "upper", "status")

ENTRY = np.dtype(
    [
        ("key", np.uint64),  # (smaller id << 32) | larger id
        ("until", np.float64),  # s: looked for until then; what comes near each other later is found again
        ("i", np.int32),  # body slots; body i has the smaller id
        ("j", np.int32),
        ("version_i", np.uint32),
        ("version_j", np.uint32),
    ]
)

Records = NDArray[np.void]
Pairs = NDArray[np.int32]


@kernel
def renew(entries, pairs, bodies, spread, now, renewed):
    """The entries that still hold, then those of the pairs (P, 2) in which a body may be uncertain, into renewed.

    A body whose box allows for uncertainty is not looked at anew when it declares some again. Returns how many.
    """
    n = 0
    motion = bodies.motion
    for k in range(entries.size):
        entry = entries[k]
        holds = bodies.version[entry.i] == entry.version_i and bodies.version[entry.j] == entry.version_j
        if holds and entry.until >= now:
            renewed[n] = entry
            n += 1
    for k in range(pairs.shape[0]):
        i, j = pairs[k, 0], pairs[k, 1]
        widened = motion[i].spread_0 + motion[i].spread_1 + motion[j].spread_0 + motion[j].spread_1 > 0.0
        if not (widened or is_uncertain(spread, i) or is_uncertain(spread, j)):
            continue
        if bodies.id[i] > bodies.id[j]:
            i, j = j, i
        entry = renewed[n]
        entry.key = (np.uint64(bodies.id[i]) << np.uint64(32)) | np.uint64(bodies.id[j])
        entry.until = min(motion[i].cover, motion[j].cover)
        entry.i, entry.j = i, j
        entry.version_i, entry.version_j = bodies.version[i], bodies.version[j]
        n += 1
    return n


@lru_cache(maxsize=16)
def sigmas_for(probability: float) -> float:
    """How many standard deviations off bodies may be that meet with less than this probability.

    For flat faces: to meet, one of the errors of the two positions and the two velocities must exceed it, and four
    times the probability that one does is less than what is asked for.
    """
    return NormalDist().inv_cdf(1.0 - 0.25 * min(probability, 0.9))


class Scene(NamedTuple):
    """What is asked about: the shapes and bodies as the kernels read them, the time (s), the settings."""

    table: Any
    parts: Any
    bodies: Bodies
    now: float
    profile: Any  # profiles.Profile
    planar: bool
    pool: ThreadPoolExecutor | None


class UncertainPredictions:
    """The uncertainties of all bodies, and the pairs that only they could bring together."""

    def __init__(self, capacity: int) -> None:
        self.active = False
        """Whether any state has declared an uncertainty, or any object how hard it may accelerate."""
        self.spread = make_spread(capacity)
        self.entries: Records = np.empty(0, ENTRY)
        """The pairs, by key."""
        self._rooms = [make_room()]  # one for each thread

    def enlarge(self, capacity: int) -> None:
        """Room for more bodies; the slots stay."""
        spread = make_spread(capacity)
        enlarge(self.spread, spread)
        self.spread = spread

    def describe(self, i: int, d: ObjectDescription) -> None:
        """Take in what the object in slot i has declared of its accelerations."""
        bounds = (0.0, 0.0) if d.static else (d.max_linear_acceleration, d.max_angular_acceleration)
        self.spread.acceleration[i] = bounds
        self.active |= any(bounds)

    def forget(self, i: int) -> None:
        """The body in slot i is gone."""
        for array in self.spread:
            array[i] = 0.0
        self.active = bool(self.spread.stddev.any() or self.spread.acceleration.any())

    def take(self, slots: Pairs, numbers: Any, covariance: NDArray[np.float64], planar: bool) -> None:
        """Take in the uncertainties of states that were accepted; arguments as of `take_spread`."""
        take_spread(self.spread, slots, numbers, covariance, planar)
        self.active = True

    def sigmas(self, profile: Any) -> float:
        """By how many standard deviations swept boxes are widened; 0 while nobody is uncertain."""
        return sigmas_for(profile.min_probability) if self.counts(profile) else 0.0

    def counts(self, profile: Any) -> bool:
        """Whether anything is uncertain, and the profile wants to know."""
        return self.active and bool(profile.uncertainty)

    def add_pairs(self, pairs: Pairs, bodies: Bodies, now: float) -> None:
        """Pairs (P, 2) whose swept boxes meet, found in this step; what no longer holds is dropped."""
        renewed = np.empty(len(self.entries) + len(pairs), ENTRY)
        entries = renewed[: renew(self.entries, pairs, bodies, self.spread, now, renewed)]
        if len(pairs):
            entries = entries[np.lexsort((entries["until"], entries["key"]))]
            entries = entries[np.append(entries["key"][1:] != entries["key"][:-1], True)[: len(entries)]]
        self.entries = entries

    def complete(self, predictions: Records, slots: Pairs, touching: NDArray[np.uint64], scene: Scene) -> Records:
        """Fill in times and probabilities, and add the pairs that may meet though they are stated to pass.

        predictions (n,): of stated motions, with the body slots (n, 2); touching: keys of the pairs that touch now.
        Returns them soonest first.
        """
        self._widen(predictions, slots, scene)
        if not self.counts(scene.profile):
            return _sorted(predictions)
        for name, column in zip(ANSWERS, self._judge(slots, True, scene).T, strict=True):
            predictions[name] = column
        self.add_pairs(np.empty((0, 2), np.int32), scene.bodies, scene.now)
        known = (predictions["id_a"].astype(np.uint64) << np.uint64(32)) | predictions["id_b"]
        entries = self.entries[~np.isin(self.entries["key"], np.concatenate([known, touching]))]
        if len(entries) == 0:
            return _sorted(predictions)
        slots = np.stack([entries["i"], entries["j"]], axis=1)
        answers = self._judge(slots, False, scene)
        kept = answers[:, PROBABILITY] >= scene.profile.min_probability
        both = np.concatenate([predictions, _possible(entries["key"][kept], slots[kept], answers[kept], scene)])
        return _sorted(both)

    def _widen(self, predictions: Records, slots: Pairs, scene: Scene) -> None:
        """Widen the intervals of bodies that have declared how hard they may accelerate."""
        if not self.spread.acceleration.any():
            return
        p = scene.profile
        ends = [np.ascontiguousarray(predictions[name]) for name in INTERVAL]
        widen_intervals(
            scene.table, scene.parts, scene.bodies, self.spread, slots, scene.now, p.horizon, p.contact_margin,
            p.impact_tolerance, p.impact_iterations, self._rooms[0], *ends,
        )  # fmt: skip
        for name, column in zip(INTERVAL, ends, strict=True):
            predictions[name] = column

    def _judge(self, slots: Pairs, stated: bool, scene: Scene) -> NDArray[np.float64]:
        """Answers (n, 4) for pairs of body slots (n, 2), on all threads; the same for any number of them."""
        p = scene.profile
        samples = normal_samples(p.uncertainty_samples)
        sigmas, safe_sigmas = sigmas_for(p.min_probability), sigmas_for(p.min_probability * (1.0 - p.confidence))

        def part(slots: Pairs, room: Room) -> NDArray[np.float64]:
            answers = np.empty((len(slots), len(ANSWERS)))
            impact_probabilities(
                scene.table, scene.parts, scene.bodies, self.spread, slots, stated, scene.now, p.horizon,
                p.contact_margin, p.stale_acceleration, p.impact_tolerance, p.impact_iterations, p.confidence, sigmas,
                safe_sigmas, p.min_probability, scene.planar, *samples, room, answers,
            )  # fmt: skip
            return answers

        if scene.pool is None or len(slots) < FEWEST_PAIRS_FOR_THREADS:
            return part(slots, self._rooms[0])
        while len(self._rooms) < p.threads:
            self._rooms.append(make_room())
        rooms = self._rooms[: p.threads]
        return np.concatenate(list(scene.pool.map(part, np.array_split(slots, len(rooms)), rooms)))


def _sorted(predictions: Records) -> Records:
    return predictions[np.lexsort((predictions["id_b"], predictions["id_a"], predictions["lower"]))]


def _possible(keys: NDArray[np.uint64], slots: Pairs, answers: NDArray[np.float64], scene: Scene) -> Records:
    """Predictions (records.PREDICTION) of pairs that may meet though they are stated to pass."""
    p, bodies = scene.profile, scene.bodies
    rows = np.zeros(len(keys), PREDICTION)
    for name, column in zip(ANSWERS, answers.T, strict=True):
        rows[name] = column
    rows["lower"], rows["upper"] = rows["earliest"], inf
    for name in ("point", "normal", "closing_speed"):
        rows[name] = nan
    rows["id_a"], rows["id_b"] = keys >> np.uint64(32), keys & np.uint64(0xFFFFFFFF)
    rows["status"], rows["method"] = PredictionStatus.POSSIBLE, Method.SAMPLING
    rows["model_a"], rows["model_b"] = bodies.model[slots].T
    old = ~bodies.static[slots] & (scene.now - bodies.time[slots] > p.stale_after)
    rows["stale"] = old.any(axis=1)
    return rows
