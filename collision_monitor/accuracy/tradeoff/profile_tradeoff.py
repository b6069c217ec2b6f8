"""Time and errors of each profile on one scene, against exact answers that are recomputed at every step."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace
from math import inf
from typing import Any

import numpy as np

from collision_monitor.accuracy.playback import Step, play_steps
from collision_monitor.accuracy.reference_monitor import ReferenceMonitor
from collision_monitor.accuracy.reported import Reported
from collision_monitor.accuracy.scope import compared, unfiltered
from collision_monitor.accuracy.tradeoff.measurement import Measurement
from collision_monitor.accuracy.tuning.tally import Tally, compare_reports
from collision_monitor.errors import InputError
from collision_monitor.monitor.monitor import Monitor
from collision_monitor.monitor.state.timeline import NANOSECOND
from collision_monitor.objects.description import ObjectDescription
from collision_monitor.session.history.alarms import CertainContacts
from collision_monitor.settings.profile import Profile

REFERENCE = "exact"
"""Profile of the exact answers. Uncertainty is off, because the uncertainty of the states is no error of a profile."""

Progress = Callable[[int], None]


def exact_answers(
    described: Iterable[ObjectDescription],
    steps: Sequence[Step],
    profile: Profile,
    progress: Progress,
    most_seconds: float = inf,
) -> tuple[Reported, int]:
    """Return the exact answers with the horizon, contact margin and region of the profile, and the number of steps.

    most_seconds: time of the steps after which the others are left out.
    """
    exact = Profile.named(REFERENCE).replace(uncertainty=False, **compared(profile))
    answers = play_steps(ReferenceMonitor(exact), described, steps, progress, most_seconds).answers
    return Reported.of(answers), len(answers)


def contacts_of(steps: Sequence[Step], truth: Reported, horizon: float) -> CertainContacts:
    """Return the contacts among the exact answers to all steps, which judge the alarms of profiles."""
    times = np.maximum.accumulate([stamp for stamp, _ in steps]) * NANOSECOND
    return CertainContacts.of(times, truth.contacts, truth.contact_step, horizon)


def measure_profile(
    described: Iterable[ObjectDescription],
    steps: Sequence[Step],
    profile: Profile,
    truth: Reported,
    contacts: CertainContacts,
    *,
    first: int = 0,
    most_seconds: float = inf,
    progress: Progress = lambda done: None,
) -> Tally:
    """Play a profile over consecutive steps, and compare its answers with the exact ones to the same steps.

    Its filters are off, because they only remove answers.

    first: place of the first of these steps among those of `contacts`. most_seconds: time of the steps, after which
    the others are left out.
    """
    played = play_steps(Monitor(unfiltered(profile), warns=False), described, steps, progress, most_seconds)
    count = len(played.answers)
    if count < len(steps):
        truth = truth.until(count)
    mine = Reported.of(played.answers)
    judged = contacts.judge(mine.contacts, mine.contact_step + first, mine.predictions, mine.prediction_step + first)
    seconds, pairs = played.warm()
    return replace(compare_reports(mine, truth, profile), steps=count, alarms=judged, seconds=seconds, pairs=pairs)


def profile_tradeoff(
    scene: str,
    descriptions: Iterable[ObjectDescription],
    steps: Sequence[Step],
    profiles: Sequence[str | Profile],
    progress: Progress = lambda done: None,
) -> list[Measurement]:
    """Return a row for each profile, in order. The exact answers use the horizon of the profile. Raises InputError.

    progress: called with the number of steps just done; the total is len(steps) * 2 * len(profiles).
    """
    if not steps:
        raise InputError(f"scene {scene}: expected at least one step, there is none")
    described = list(descriptions)
    rows = []
    truths: dict[tuple[Any, ...], tuple[Reported, CertainContacts]] = {}
    for each in profiles:
        profile = Profile.named(each) if isinstance(each, str) else each
        key = tuple(compared(profile).values())
        if key in truths:
            progress(len(steps))
        else:
            truth, _ = exact_answers(described, steps, profile, progress)
            truths[key] = truth, contacts_of(steps, truth, profile.horizon)
        tally = measure_profile(described, steps, profile, *truths[key], progress=progress)
        rows.append(tally.measurement(scene, profile, len(described)))
    return rows
