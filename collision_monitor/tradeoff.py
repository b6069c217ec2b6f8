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

from collision_monitor.description import ObjectDescription
from collision_monitor.errors import InputError, MessageError
from collision_monitor.monitor import Monitor, StepResult
from collision_monitor.plain import PlainMonitor
from collision_monitor.profiles import Profile
from collision_monitor.records import Phase

REFERENCE = "exact"
"""The profile whose plain recomputation is the truth."""

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
    """Over the predictions that both have."""
    outside_bound: int
    """Predictions whose interval does not meet the true one; of models: distances that are off by more than stated."""
    distance_error_part: float = np.nan
    """Of models: the worst distance error as part of the size of the smaller of the two."""

    def to_dict(self) -> dict[str, Any]:
        """Plain values for JSON; what there is none of is null."""
        return _without_nan(asdict(self))


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
            truths[key] = _play(PlainMonitor(exact), described, steps, progress)[0]
        answers, seconds = _play(Monitor(profile), described, steps, progress)
        rows.append(_compare(scene, profile, len(described), answers, truths[key], seconds))
    return rows


def _play(
    monitor: Monitor, described: list[ObjectDescription], steps: Sequence[Step], progress: Callable[[int], None]
) -> tuple[list[StepResult], NDArray[np.float64]]:
    for description in described:
        monitor.describe(description)
    answers, seconds = [], np.empty(len(steps))
    for k, (stamp, states) in enumerate(steps):
        begin = time.perf_counter()
        answers.append(monitor.step(stamp, states))
        seconds[k] = time.perf_counter() - begin
        progress(1)
    return answers, seconds


def _by_pair(answers: NDArray[np.void]) -> dict[tuple[int, int], Any]:
    return {(int(answer["id_a"]), int(answer["id_b"])): answer for answer in answers}


def _compare(
    scene: str,
    profile: Profile,
    objects: int,
    answers: list[StepResult],
    truths: list[StepResult],
    seconds: NDArray[np.float64],
) -> Row:
    alarms = false_alarms = misses = outside = 0
    distances: list[float] = []
    times: list[float] = []
    for mine, truth in zip(answers, truths, strict=True):
        touching, really = (_by_pair(r.contacts[r.contacts["phase"] != Phase.END]) for r in (mine, truth))
        stated, true = _by_pair(mine.predictions), _by_pair(truth.predictions)
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
            times.append(float(stated[pair]["lower"] - event["lower"]))
            outside += bool(stated[pair]["lower"] > event["upper"] or stated[pair]["upper"] < event["lower"])
    warm = seconds[1:] if len(seconds) > 1 else seconds  # the first step takes everything in
    pairs = sum(a.status.narrow_phase_tests + a.status.impact_queries for a in answers[1:] or answers)
    return Row(
        scene=scene,
        profile=profile.name,
        model="exact",
        objects=objects,
        steps=len(answers),
        step_ms=float(np.median(warm)) * 1e3,
        step_ms_p99=float(np.percentile(warm, 99)) * 1e3,
        pair_us=float(warm.sum()) * 1e6 / pairs if pairs else float("nan"),
        alarms=alarms,
        false_alarms=false_alarms,
        misses=misses,
        distance_error_m=float(np.abs(distances).max()) if distances else float("nan"),
        ttc_error_s=Errors.of(times),
        outside_bound=outside,
    )
