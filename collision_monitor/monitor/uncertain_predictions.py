"""Uncertain predictions: times and probabilities of impact from declared uncertainties, also for pairs stated to pass.

Pairs whose stated motions pass each other are kept in a list like the event list: an entry holds as long as the
motions of both bodies hold. Nothing here runs until a state declares an uncertainty or an object an acceleration.
"""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from functools import lru_cache
from math import inf, nan
from statistics import NormalDist
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from collision_monitor._jit import kernel
from collision_monitor.impact.acceleration_bounds import Intervals, widen_intervals
from collision_monitor.impact.impact_record import holds, ids_of_keys, pair_keys, write_pair
from collision_monitor.impact.pair_impacts import cover_of
from collision_monitor.monitor.budget import SAMPLE, PairBudget
from collision_monitor.monitor.pair_probabilities import (
    ANSWERS,
    FINEST_WITH_PLANES,
    Workspaces,
    make_workspaces,
    pair_probabilities,
    with_plans,
)
from collision_monitor.monitor.shared_work import share
from collision_monitor.monitor.state.snapshot import Facts, Snapshot, Stage
from collision_monitor.monitor.step_context import StepContext
from collision_monitor.motion.bodies import enlarge
from collision_monitor.objects.description import ObjectDescription
from collision_monitor.records import PREDICTION, Method, PredictionStatus
from collision_monitor.settings.profile import Profile
from collision_monitor.uncertainty.impact_distribution import EARLIEST, MOST_LIKELY, PROBABILITY
from collision_monitor.uncertainty.near_pairs import NearPairRange, find_near
from collision_monitor.uncertainty.plane_probability import plane_probabilities
from collision_monitor.uncertainty.sampled_impacts import (
    Sampling,
)
from collision_monitor.uncertainty.samples.normal_samples import normal_samples, sample_columns
from collision_monitor.uncertainty.spread import FIFTH_ROOT, Spread, is_uncertain, make_spread, take_spread

Pool = ThreadPoolExecutor | None
"""Threads that share the work; None: one thread."""

FEWEST_SAMPLED_PAIRS_FOR_THREADS: Final = 8
"""Fewer pairs stay on one thread: passing work to another costs as much as some of them."""

INTERVAL: Final = ("lower", "upper", "status")

ENTRY = np.dtype(
    [
        ("key", np.uint64),  # pair_key of the ids
        ("until", np.float64),  # s: end of the prediction; the broad phase finds the pair again for later times
        ("i", np.int32),  # body slots; body i has the smaller id
        ("j", np.int32),
        ("version_i", np.uint32),
        ("version_j", np.uint32),
    ]
)

Records = NDArray[np.void]
Pairs = NDArray[np.int32]


@kernel
def renew(entries: Any, pairs: Any, bodies: Any, spread: Spread, now: float, renewed: Any) -> int:
    """Write the entries that still hold, then those of the pairs (P, 2) in which a body may be uncertain, into renewed.

    A pair also counts if a body's box is wide enough for uncertainty, because a body that declares some later within
    that width starts no new search. Returns the number of entries.
    """
    n = 0
    motion = bodies.motion
    for k in range(entries.size):
        entry = entries[k]
        if holds(bodies.version, entry) and entry.until >= now:
            renewed[n] = entry
            n += 1
    for k in range(pairs.shape[0]):
        i, j = pairs[k, 0], pairs[k, 1]
        widened = motion[i].spread_0 + motion[i].spread_1 + motion[j].spread_0 + motion[j].spread_1 > 0.0
        if not (widened or is_uncertain(spread, i) or is_uncertain(spread, j)):
            continue
        if bodies.id[i] > bodies.id[j]:
            i, j = j, i
        write_pair(bodies, i, j, renewed[n])
        renewed[n].until = cover_of(bodies, i, j)
        n += 1
    return n


@lru_cache(maxsize=16)
def sigmas_for(probability: float) -> float:
    """Number of standard deviations by which bodies may be off if they meet with less than this probability.

    For flat faces: to meet, one of the errors of the two positions and the two velocities must exceed this number. Four
    times the probability that one error does so is `probability`, which is clipped to 0.9.
    """
    return NormalDist().inv_cdf(1.0 - 0.25 * min(probability, 0.9))


class UncertainPredictions(Stage):
    """The uncertainties of all bodies, and the pairs that may meet because of them."""

    SAVED = ("active", "spread", "entries")
    CACHES = ("_workspaces",)

    def __init__(self, capacity: int) -> None:
        self.active = False
        """Whether any state has declared an uncertainty, or any object a bound on its acceleration."""
        self.spread = make_spread(capacity)
        self.entries: Records = np.empty(0, ENTRY)
        """The pairs (ENTRY), sorted by key."""
        self._workspaces = [make_workspaces(Profile().uncertainty_samples)]  # one for each thread

    # ------------------------------------------------------------------ the bodies

    def enlarge(self, capacity: int) -> None:
        """Make room for `capacity` bodies; the slots stay."""
        if len(self.spread.stddev) < capacity:
            spread = make_spread(capacity)
            enlarge(self.spread, spread)
            self.spread = spread

    def describe(self, i: int, d: ObjectDescription) -> None:
        """Store the acceleration bounds that the object in slot i declares. A static object has no uncertainty."""
        if d.static:
            self._clear(i)
            return
        bounds = d.max_linear_acceleration, d.max_angular_acceleration
        self.spread.acceleration[i] = bounds
        self.active |= any(bounds)

    def forget(self, i: int) -> None:
        """Clear the uncertainty of the body in slot i, which is removed."""
        self._clear(i)
        self.active = bool(self.spread.stddev.any() or self.spread.acceleration.any())

    def _clear(self, i: int) -> None:
        for array in self.spread:
            array[i] = 0.0

    def take(
        self, slots: Pairs, numbers: Any, flags: NDArray[np.uint32], covariance: NDArray[np.float64], planar: bool
    ) -> None:
        """Store the uncertainties of accepted states; for the arguments see `take_spread`."""
        take_spread(self.spread, slots, numbers, flags, covariance, planar)
        self.active = True

    def sigmas(self, profile: Profile) -> float:
        """Number of standard deviations by which swept boxes are widened; 0 while nothing is uncertain.

        With declared bounds on accelerations, at least so many that the boxes hold what these allow.
        """
        if not self.counts(profile):
            return 0.0
        sigmas = sigmas_for(profile.min_probability)
        return max(sigmas, 1.0 / FIFTH_ROOT) if self.spread.acceleration.any() else sigmas

    def counts(self, profile: Profile) -> bool:
        """Whether anything is uncertain, and the profile includes it."""
        return self.active and profile.uncertainty

    # ------------------------------------------------------------------ the step

    def add_pairs(self, step: StepContext, pairs: Pairs) -> None:
        """Add pairs (P, 2) whose swept boxes overlap, found in this step. Drop the entries that no longer hold."""
        if not self.counts(step.profile):
            return
        renewed = np.empty(len(self.entries) + len(pairs), ENTRY)
        entries = renewed[: renew(self.entries, pairs, step.roster.bodies, self.spread, step.now, renewed)]
        if len(pairs):
            order = np.argsort(entries["key"], kind="stable")  # an entry that is found again holds longer
            keys = entries["key"][order]
            entries = entries[order[np.append(keys[1:] != keys[:-1], True)[: len(keys)]]]
        self.entries = entries

    def complete(
        self,
        step: StepContext,
        predictions: Records,
        slots: Pairs,
        touching: NDArray[np.uint64],
        pool: Pool,
        budget: PairBudget | None,
    ) -> Records:
        """Fill in times and probabilities of predictions, and add the pairs that may meet though stated to pass.

        predictions (n,): of the stated motions; slots (n, 2): their body slots; touching: keys of the pairs that touch
        now. Returns the predictions, soonest first. A pair that the budget leaves out is UNRESOLVED, without a
        probability.
        """
        if not step.profile.horizon > 0.0:
            return predictions
        self._widen(step, predictions, slots, np.flatnonzero(~with_plans(step.roster.bodies, slots)))
        if not self.counts(step.profile):
            return _sorted(predictions)
        answers, done = self._judge_urgent(step, slots, predictions["lower"], True, pool, budget)
        for name, column in zip(ANSWERS, answers.T, strict=True):
            predictions[name] = column
        predictions["status"][~done] = PredictionStatus.UNRESOLVED
        self.add_pairs(step, np.empty((0, 2), np.int32))
        known = pair_keys(predictions["id_a"], predictions["id_b"])
        entries = _without(self._near(step), np.concatenate([known, touching]))
        possible = self._with_bounded(step, entries, self._judge_passing(step, entries, pool, budget))
        if budget is not None:
            budget.stop()
        return _sorted(np.concatenate([predictions, possible]) if len(possible) else predictions)

    def _near(self, step: StepContext) -> Records:
        """Return the entries of the pairs that could meet within the horizon."""
        p, found = step.profile, np.empty(len(self.entries), np.int64)
        sigmas = self.sigmas(p)
        nearness = NearPairRange(sigmas, step.settings.impact.margin, p.horizon, p.stale_acceleration)
        count = find_near(step.roster.multibody, self.spread, self.entries, step.now, nearness, found)
        return self.entries[found[:count]]

    def _judge_passing(self, step: StepContext, entries: Records, pool: Pool, budget: PairBudget | None) -> Records:
        """Return predictions of the pairs (ENTRY) that are stated to pass, and meet with enough probability."""
        slots = np.stack([entries["i"], entries["j"]], axis=1)
        if budget is None:
            answers = self._judge(step, slots, False, pool)
            kept = answers[:, PROBABILITY] >= step.profile.min_probability
            return _possible(step, entries["key"][kept], slots[kept], answers[kept])
        bounds = self._screen(step, slots)
        near = np.flatnonzero(~np.isnan(bounds[:, PROBABILITY]))
        answers, done = self._judge_urgent(step, slots[near], bounds[near, MOST_LIKELY], False, pool, budget)
        kept = ~done | (answers[:, PROBABILITY] >= step.profile.min_probability)
        rows = _possible(step, entries["key"][near[kept]], slots[near[kept]], answers[kept])
        left = ~done[kept]
        rows["status"][left], rows["method"][left] = PredictionStatus.UNRESOLVED, Method.BOUND
        rows["lower"][left] = bounds[near[kept][left], EARLIEST]
        return rows

    def _with_bounded(self, step: StepContext, entries: Records, possible: Records) -> Records:
        """Add predictions of the pairs (ENTRY) that the declared bounds on accelerations allow to meet.

        They are reported however improbable that is; their lower ends are safe. A body that follows its plan does not
        accelerate otherwise. possible: predictions of some of them.
        """
        if not self.spread.acceleration.any():
            return possible
        slots = np.stack([entries["i"], entries["j"]], axis=1)
        alone = ~with_plans(step.roster.bodies, slots)
        entries, slots, horizon, n = entries[alone], slots[alone], step.profile.horizon, np.count_nonzero(alone)
        if not n:
            return possible
        first = np.full(n, horizon)
        intervals = Intervals(slots, first, np.full(n, inf), np.zeros(n, PREDICTION["status"]))
        query, work = step.settings.impact, self._workspaces[0].exact
        widen_intervals(step.roster.multibody, self.spread, intervals, step.now, horizon, query, work)
        meet = first < horizon
        keys, first, slots = entries["key"][meet], first[meet], slots[meet]
        at = np.searchsorted(keys, known := pair_keys(possible["id_a"], possible["id_b"]))  # both ascend by key
        is_known = np.zeros(len(keys), np.bool_)
        if len(keys):
            at = np.minimum(at, len(keys) - 1)
            same = keys[at] == known
            possible["lower"][same] = np.minimum(possible["lower"][same], first[at[same]])
            is_known[at[same]] = True
        new = ~is_known
        answers = np.full((np.count_nonzero(new), len(ANSWERS)), nan)
        answers[:, EARLIEST] = first[new]
        rows = _possible(step, keys[new], slots[new], answers)
        rows["method"] = Method.BOUND
        return np.concatenate([possible, rows])

    def _judge_urgent(
        self,
        step: StepContext,
        slots: Pairs,
        soon: NDArray[np.float64],
        stated: bool,
        pool: Pool,
        budget: PairBudget | None,
    ) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
        """Compute the answers (n, 4) of the pairs within the budget, those with the least `soon` (n,) first.

        Returns the answers, NaN for the others, and the mask (n,) of the pairs that were done.
        """
        if budget is None:
            return self._judge(step, slots, stated, pool), np.ones(len(slots), np.bool_)
        answers, done = np.full((len(slots), len(ANSWERS)), nan), np.zeros(len(slots), np.bool_)
        order, at = np.argsort(soon, kind="stable"), 0
        while at < len(order) and (count := budget.next(len(order) - at, SAMPLE)):
            some = order[at : at + count]
            answers[some], done[some] = self._judge(step, slots[some], stated, pool), True
            at += count
        step.work.deferred += len(order) - at
        return answers, done

    def _widen(self, step: StepContext, predictions: Records, slots: Pairs, which: NDArray[np.intp]) -> None:
        """Widen the intervals `which` (k,) of the bodies that declare bounds on their accelerations."""
        if not self.spread.acceleration.any():
            return
        ends = [predictions[name][which] for name in INTERVAL]
        intervals, query, horizon = Intervals(slots[which], *ends), step.settings.impact, step.profile.horizon
        work = self._workspaces[0].exact
        widen_intervals(step.roster.multibody, self.spread, intervals, step.now, horizon, query, work)
        for name, column in zip(INTERVAL, ends, strict=True):
            predictions[name][which] = column

    def _sampling(self, step: StepContext, stated: bool) -> Sampling:
        p = step.profile
        return Sampling(
            step.settings.impact,
            p.horizon,
            p.stale_acceleration,
            stated,
            sigmas_for(p.min_probability),
            sigmas_for(p.min_probability * (1.0 - p.confidence)),
            p.min_probability,
            p.confidence,
            step.roster.planar,
            *normal_samples(p.uncertainty_samples),
            stops_early=p.impact_tolerance >= FINEST_WITH_PLANES,
        )

    def _screen(self, step: StepContext, slots: Pairs) -> NDArray[np.float64]:
        """Bound pairs of body slots (n, 2) that are stated to pass; NaN if they meet with too little probability."""
        sampling = self._sampling(step, False)._replace(only_screens=True)
        columns, multibody = sample_columns(step.profile.uncertainty_samples), step.roster.multibody
        exact, planes = self._workspaces[0]
        bounds = np.empty((len(slots), len(ANSWERS)))
        plane_probabilities(multibody, self.spread, slots, step.now, sampling, columns, planes, exact, bounds)
        return bounds

    def _judge(self, step: StepContext, slots: Pairs, stated: bool, pool: Pool) -> NDArray[np.float64]:
        """Compute the answers (n, 4) for pairs of body slots (n, 2) on all threads; their number changes no answer."""
        p, sampling = step.profile, self._sampling(step, stated)

        def part(slots: Pairs, work: Workspaces) -> tuple[NDArray[np.float64], int]:
            return pair_probabilities(step.roster.multibody, self.spread, slots, step.now, sampling, p, work)

        if len(self._workspaces[0].planes.times) != p.uncertainty_samples:
            self._workspaces = [make_workspaces(p.uncertainty_samples)]
        if pool is None or len(slots) < FEWEST_SAMPLED_PAIRS_FOR_THREADS:
            answers, followed = part(slots, self._workspaces[0])
            step.samples += followed
            return answers
        while len(self._workspaces) < p.threads:
            self._workspaces.append(make_workspaces(p.uncertainty_samples))
        parts = share(pool, part, slots, self._workspaces[: p.threads])
        step.samples += sum(followed for _, followed in parts)
        return np.concatenate([answers for answers, _ in parts])

    # ------------------------------------------------------------------ snapshots

    def save(self, snapshot: Snapshot, facts: Facts) -> None:
        """See Stage."""
        top = len(snapshot.arrays["bodies.used"])
        spread = {f"spread.{name}": column[:top].copy() for name, column in self.spread._asdict().items()}
        snapshot.arrays.update(spread, possible=self.entries.copy())
        facts["uncertain"] = self.active

    def restore(self, snapshot: Snapshot, facts: Facts) -> None:
        """See Stage."""
        top = len(snapshot.arrays["bodies.used"])
        saved = Spread(**snapshot.columns("spread", self.spread, top))
        self.enlarge(top)
        enlarge(saved, self.spread)
        self.entries = snapshot.array("possible", np.empty(0, ENTRY))
        snapshot.check_slots("possible", self.entries)
        self.active = facts["uncertain"]


def _without(entries: Records, keys: NDArray[np.uint64]) -> Records:
    """Return the entries (ENTRY), sorted by key, without those of some keys."""
    if not len(entries) or not len(keys):
        return entries
    own = np.ascontiguousarray(entries["key"])
    at = np.minimum(np.searchsorted(own, keys), len(own) - 1)
    kept = np.ones(len(own), np.bool_)
    kept[at[own[at] == keys]] = False
    return entries[kept]


def _sorted(predictions: Records) -> Records:
    return predictions[np.lexsort((predictions["id_b"], predictions["id_a"], predictions["lower"]))]


def _possible(step: StepContext, keys: NDArray[np.uint64], slots: Pairs, answers: NDArray[np.float64]) -> Records:
    """Build the predictions (records.PREDICTION) of pairs that may meet though they are stated to pass."""
    bodies = step.roster.bodies
    rows = np.zeros(len(keys), PREDICTION)
    for name, column in zip(ANSWERS, answers.T, strict=True):
        rows[name] = column
    rows["lower"], rows["upper"] = rows["earliest"], inf
    for name in ("point", "normal", "closing_speed"):
        rows[name] = nan
    rows["id_a"], rows["id_b"] = ids_of_keys(keys)
    rows["status"], rows["method"] = PredictionStatus.POSSIBLE, Method.SAMPLING
    rows["model_a"], rows["model_b"] = bodies.model[slots].T
    old = ~bodies.static[slots] & (step.now - bodies.time[slots] > step.profile.stale_after)
    rows["stale"] = old.any(axis=1)
    return rows
