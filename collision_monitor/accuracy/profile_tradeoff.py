"""Time and errors of each profile on one scene, against exact answers that are recomputed at every step."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence

import numpy as np
from numpy.typing import NDArray

from collision_monitor.accuracy.measurement import Errors, Measurement
from collision_monitor.accuracy.playback import Played, Step, by_pair, contacts_by_pair, play
from collision_monitor.accuracy.reference_monitor import ReferenceMonitor
from collision_monitor.errors import InputError
from collision_monitor.monitor.monitor import Monitor
from collision_monitor.monitor.result import StepResult
from collision_monitor.objects.description import ObjectDescription
from collision_monitor.records import PredictionStatus
from collision_monitor.settings.profile import Profile

REFERENCE = "exact"
"""Profile of the exact answers. Uncertainty is off, because the uncertainty of the states is no error of a profile."""


def profile_tradeoff(
    scene: str,
    descriptions: Iterable[ObjectDescription],
    steps: Sequence[Step],
    profiles: Sequence[str | Profile],
    progress: Callable[[int], None] = lambda done: None,
) -> list[Measurement]:
    """Return a row for each profile, in order. The exact answers use the horizon of the profile. Raises InputError.

    progress: called with the number of steps just done; the total is len(steps) * 2 * len(profiles).
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
            truths[key] = play(ReferenceMonitor(exact.replace(uncertainty=False)), described, steps, progress).answers
        played = play(Monitor(profile), described, steps, progress)
        rows.append(_compare(scene, profile, len(described), played, truths[key]))
    return rows


def _stated(answer: StepResult) -> NDArray[np.void]:
    """Return the predictions of the stated motions, without those that are possible only through uncertainty."""
    return answer.predictions.compress(answer.predictions["status"] != PredictionStatus.POSSIBLE)


def _compare(scene: str, profile: Profile, objects: int, played: Played, truths: list[StepResult]) -> Measurement:
    alarms = false_alarms = misses = compared = outside = 0
    distances: list[float] = []
    times: list[float] = []
    for mine, truth in zip(played.answers, truths, strict=True):
        touching, actual = (contacts_by_pair(answer) for answer in (mine, truth))
        stated, true = by_pair(_stated(mine)), by_pair(truth.predictions)
        reported = touching.keys() | stated.keys()
        alarms += len(reported)
        false_alarms += len(reported - actual.keys() - true.keys())
        misses += len(actual.keys() - reported)
        edge = profile.horizon - 2.0 * profile.impact_tolerance
        misses += sum(pair not in reported and event["upper"] < edge for pair, event in true.items())
        for pair in touching.keys() & actual.keys():
            distances.append(float(touching[pair]["signed_distance"] - actual[pair]["signed_distance"]))
        for pair in stated.keys() & true.keys():
            event = true[pair]
            if event["status"] == PredictionStatus.HIT:
                times.append(float(stated[pair]["lower"] - event["lower"]))
            compared += 1
            outside += bool(stated[pair]["lower"] > event["upper"] or stated[pair]["upper"] < event["lower"])
    return Measurement(
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
