"""What speed costs in accuracy: one scene through each profile, against exact answers computed anew at every step."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Sequence
from contextlib import suppress
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from collision_monitor.accuracy.plain import PlainMonitor
from collision_monitor.errors import InputError, MessageError
from collision_monitor.monitor.monitor import Monitor
from collision_monitor.monitor.result import StepResult
from collision_monitor.objects.description import ObjectDescription
from collision_monitor.records import Phase, PredictionStatus
from collision_monitor.settings.profile import Profile

REFERENCE = "exact"
"""The profile whose plain recomputation is the truth, without what is uncertain: that is no error of a profile."""

Step = tuple[int, NDArray[np.void]]
"""A stamp (ns) and records.STATE."""


@dataclass(frozen=True)
class Errors:
    """Of a number of answers, in their unit; NaN where there was none."""

    median: float
    p99: float
    worst: float

    @classmethod
    def of(cls, values: Sequence[float]) -> Errors:
        """Of these absolute values."""
        if not values:
            return cls(np.nan, np.nan, np.nan)
        found = np.abs(values)
        return cls(float(np.median(found)), float(np.percentile(found, 99)), float(found.max()))


@dataclass(frozen=True)
class Row:
    """One profile on one scene."""

    scene: str
    profile: str
    model: str
    objects: int
    steps: int
    step_ms: float
    """Median time of a step."""
    step_ms_p99: float
    pair_us: float
    """Time of all steps by the pairs that were examined or predicted in them."""
    alarms: int
    """Contacts and predictions of all steps, a pair counted at each step."""
    false_alarms: int
    """Of these, the ones that the truth does not have at that step."""
    misses: int
    """Pairs and steps of the truth with neither contact nor prediction, but for impacts at the very horizon."""
    distance_error_m: float
    """Worst, over the contacts that both have."""
    ttc_error_s: Errors
    """Over the predictions that both have, and of which the truth is that they hit."""
    compared: int
    """Answers that both have and that state a bound: predictions, or of models distances."""
    outside_bound: int
    """Of these, intervals that the true time is not in; of models, distances that are off by more than stated."""
    distance_error_part: float = np.nan
    """Of models: the worst distance error as part of the size of the smaller of the two."""
    noise: float = 0.0
    """Of the scene's states (m, rad, m/s and rad/s), see `world.measured`."""

    @property
    def label(self) -> str:
        """The scene, for people."""
        return f"{self.scene} ± {self.noise:g}" if self.noise else self.scene

    @property
    def within_bound(self) -> float:
        """Part of the compared answers whose bound holds; NaN where there was none."""
        return 1.0 - self.outside_bound / self.compared if self.compared else np.nan

    def to_dict(self) -> dict[str, Any]:
        """Plain values for JSON; what there is none of is null."""
        return _without_nan(asdict(self) | {"within_bound": self.within_bound})


@dataclass(frozen=True)
class Played:
    """What a monitor answered at each step, and how long that took (s)."""

    answers: list[StepResult]
    seconds: NDArray[np.float64]

    def cost(self) -> dict[str, Any]:
        """Of a row; without the first step, which takes everything in."""
        warm = self.seconds[1:] if len(self.seconds) > 1 else self.seconds
        pairs = sum(a.status.narrow_phase_tests + a.status.impact_queries for a in self.answers[1:] or self.answers)
        return {
            "step_ms": 1e3 * float(np.median(warm)),
            "step_ms_p99": 1e3 * float(np.percentile(warm, 99)),
            "pair_us": 1e6 * float(warm.sum()) / pairs if pairs else np.nan,
        }


def _without_nan(values: dict[str, Any]) -> dict[str, Any]:
    return {
        name: _without_nan(value)
        if isinstance(value, dict)
        else None
        if isinstance(value, float) and np.isnan(value)
        else value
        for name, value in values.items()
    }


def recorded(path: Path) -> tuple[str, list[ObjectDescription], list[Step]]:
    """Name, objects and steps of a session, all objects known from the first step on, as they were described last.

    What is malformed is left out. Raises InputError where there is nothing, SessionError.
    """
    from collision_monitor.codec import decode_descriptions, decode_states
    from collision_monitor.session import Session

    described: dict[int, ObjectDescription] = {}
    steps = []
    for message in Session(path).messages():
        with suppress(MessageError):
            if message.type == "ObjectDescriptionArray":
                changes = decode_descriptions(message.data).objects
                described.update({it.object_id: it for it in changes if isinstance(it, ObjectDescription)})
            elif message.type == "ObjectStateArray":
                states = decode_states(message.data)
                steps.append((states.stamp_ns, states.states.copy()))
    if not described or not steps:
        raise InputError(f"{path}: expected object shapes and states, found {len(described)} and {len(steps)} of them")
    return path.stem, list(described.values()), steps


def tradeoff(
    scene: str,
    descriptions: Iterable[ObjectDescription],
    steps: Sequence[Step],
    profiles: Sequence[str | Profile],
    progress: Callable[[int], None] = lambda done: None,
) -> list[Row]:
    """A row for each profile, in their order; the horizon of the truth is the profile's own. Raises InputError.

    progress is told how many steps were just done, of len(steps) * 2 * len(profiles) in all.
    """
    if not steps:
        raise InputError(f"scene {scene}: expected at least one step, there is none")
    described = list(descriptions)
    rows = []
    truths: dict[tuple[float, float], list[StepResult]] = {}
    for each in profiles:
        profile = Profile.named(each) if isinstance(each, str) else each
        key = (profile.horizon, profile.contact_margin)
        if key in truths:
            progress(len(steps))
        else:
            exact = Profile.named(REFERENCE).replace(horizon=profile.horizon, contact_margin=profile.contact_margin)
            truths[key] = play(PlainMonitor(exact.replace(uncertainty=False)), described, steps, progress).answers
        played = play(Monitor(profile), described, steps, progress)
        rows.append(_compare(scene, profile, len(described), played, truths[key]))
    return rows


def play(
    monitor: Monitor, described: Iterable[ObjectDescription], steps: Sequence[Step], progress: Callable[[int], None]
) -> Played:
    """Describe everything, then take all steps. progress: told of each."""
    for description in described:
        monitor.describe(description)
    answers, seconds = [], np.empty(len(steps))
    for k, (stamp, states) in enumerate(steps):
        begin = time.perf_counter()
        answers.append(monitor.step(stamp, states))
        seconds[k] = time.perf_counter() - begin
        progress(1)
    return Played(answers, seconds)


def _by_pair(answers: NDArray[np.void]) -> dict[tuple[int, int], Any]:
    return {(int(answer["id_a"]), int(answer["id_b"])): answer for answer in answers}


def deepest(answer: StepResult) -> NDArray[np.void]:
    """Of each contact the row that tells the pair's distance."""
    rows = answer.contacts
    return rows.compress((rows["phase"] != Phase.END) & (rows["point_index"] == 0))


def _stated(answer: StepResult) -> NDArray[np.void]:
    """The predictions of stated motions: not those that only what is uncertain could bring about."""
    return answer.predictions.compress(answer.predictions["status"] != PredictionStatus.POSSIBLE)


def _compare(scene: str, profile: Profile, objects: int, played: Played, truths: list[StepResult]) -> Row:
    alarms = false_alarms = misses = compared = outside = 0
    distances: list[float] = []
    times: list[float] = []
    for mine, truth in zip(played.answers, truths, strict=True):
        touching, really = (_by_pair(deepest(answer)) for answer in (mine, truth))
        stated, true = _by_pair(_stated(mine)), _by_pair(truth.predictions)
        told = touching.keys() | stated.keys()
        alarms += len(told)
        false_alarms += len(told - really.keys() - true.keys())
        misses += len(really.keys() - told)
        edge = profile.horizon - 2.0 * profile.impact_tolerance
        misses += sum(pair not in told and event["upper"] < edge for pair, event in true.items())
        for pair in touching.keys() & really.keys():
            distances.append(float(touching[pair]["signed_distance"] - really[pair]["signed_distance"]))
        for pair in stated.keys() & true.keys():
            event = true[pair]
            if event["status"] == PredictionStatus.HIT:
                times.append(float(stated[pair]["lower"] - event["lower"]))
            compared += 1
            outside += bool(stated[pair]["lower"] > event["upper"] or stated[pair]["upper"] < event["lower"])
    return Row(
        scene=scene,
        profile=profile.name,
        model="exact",
        objects=objects,
        steps=len(played.answers),
        **played.cost(),
        alarms=alarms,
        false_alarms=false_alarms,
        misses=misses,
        distance_error_m=float(np.abs(distances).max()) if distances else float("nan"),
        ttc_error_s=Errors.of(times),
        compared=compared,
        outside_bound=outside,
    )
