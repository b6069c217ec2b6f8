"""The Pareto front of a recording: settings that no other one beats in both time and error, and the fixed part."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, Final

import numpy as np

from collision_monitor.accuracy.inputs import Workload
from collision_monitor.accuracy.playback import FEWEST_STEPS, play_steps
from collision_monitor.accuracy.tradeoff.measurement import Measurement
from collision_monitor.accuracy.tradeoff.profile_tradeoff import Progress, contacts_of, exact_answers, measure_profile
from collision_monitor.accuracy.tuning.candidates import ANY_ERROR, Space, models_of
from collision_monitor.accuracy.tuning.demands import Demands
from collision_monitor.monitor.monitor import Monitor
from collision_monitor.settings.profile import Profile

SETTING_SECONDS: Final = 3.0
"""Longest time of the steps of one setting (s). A slower one is measured on fewer steps."""
TRUTH_SECONDS: Final = 20.0
"""Longest time of the exact answers (s). The steps after it are left out."""
FEW_OBJECTS: Final = 60
"""Objects with which the kernels are loaded."""
NOTHING_TO_TRADE: Final = 1.5
"""A scene leaves nothing to trade if the smallest error costs at most this many times the cheapest setting."""


@dataclass(frozen=True)
class Front:
    """Rows of all settings, and the time of the part of a step that none of them changes (µs)."""

    rows: list[Measurement]
    fixed_us: float

    @property
    def label(self) -> str:
        """Name of the scene with its noise."""
        return self.rows[0].label

    def best(self, error: str) -> list[Measurement]:
        """Return the rows that no other row beats in time and error, cheapest first. error: "time" or "distance"."""
        found: list[Measurement] = []
        for row in sorted(self.rows, key=lambda each: (each.step_ms, error_of(each, error))):
            value = error_of(row, error)
            if value == value and (not found or value < error_of(found[-1], error)):
                found.append(row)
        return found

    def summary(self) -> str:
        """Say in one line what there is to trade, and what is fixed."""
        times = [row.step_ms for row in self.rows]
        low = min(times)
        high = max([each[-1].step_ms for each in map(self.best, ("time", "distance")) if each], default=low)
        what = "nothing to trade" if high <= NOTHING_TO_TRADE * low else f"{high / low:.3g} times to trade"
        part = min(0.1 * self.fixed_us / low, 100.0)
        return (
            f"{self.label}: {what}, {low:.3g} ms a step, {high:.3g} for the smallest error; {self.fixed_us:.0f} µs are "
            f"fixed, {part:.0f} % of the cheapest: reading the states, following the motions, the broad phase"
        )


def summaries(rows: Sequence[Measurement]) -> list[str]:
    """Return `Front.summary` of each scene whose rows have a fixed part, in order."""
    scenes: dict[str, list[Measurement]] = {}
    for row in rows:
        if row.fixed_us == row.fixed_us:
            scenes.setdefault(row.label, []).append(row)
    return [Front(found, found[0].fixed_us).summary() for found in scenes.values()]


def error_of(row: Measurement, which: str) -> float:
    """Return the 99th percentile of the errors of a row: "time" (s) or "distance" (m). NaN: no answers."""
    return row.ttc_error_s.p99 if which == "time" else row.distance_error_p99_m


def front_settings(work: Workload) -> list[Profile]:
    """Return the named profiles, looser and tighter tolerances without uncertainty, and coarser models."""
    plain = Profile.named("balanced").replace(uncertainty=False)
    fast = Profile.named("fast")
    models = models_of(work.descriptions)
    space = Space(Profile(), Demands(), uncertain=False, models=models)
    found = [Profile.named(name) for name in ("fast", "balanced", "exact")]
    found += [replace(each, uncertainty=False) for each in space.first_generation() if " × " in each.name]
    found.append(plain.replace(name="balanced, uncertainty off"))
    for value in (0.001, 0.01):
        found.append(fast.replace(name=f"fast, distance_tolerance {value:g}", distance_tolerance=value))
    for model in ("sphere", "obb", "kdop26", "convex_hull"):
        chosen: dict[str, Any] = {f"model_{kind}": model for kind, names in models.items() if model in names}
        if chosen:
            found.append(fast.replace(name=f"fast, {model}", model_error=ANY_ERROR, **chosen))
    return found


def measure_front(work: Workload, settings: Sequence[Profile], progress: Progress) -> Front:
    """Measure all settings on a recording. progress: called after each, and twice for the exact answers."""
    _load_kernels(work, settings)
    described = work.descriptions
    truth, count = exact_answers(described, work.steps, settings[0], lambda done: None, TRUTH_SECONDS)
    steps = work.steps[:count]
    contacts = contacts_of(steps, truth, settings[0].horizon)
    progress(2)
    rows = []
    for profile in settings:
        tally = measure_profile(described, steps, profile, truth, contacts, most_seconds=SETTING_SECONDS)
        rows.append(replace(tally.measurement(work.name, profile, len(described)), noise=work.noise))
        progress(1)
    return Front(rows, fixed_part(work))


def _load_kernels(work: Workload, settings: Sequence[Profile]) -> None:
    """Run each setting for two steps with a few of the objects, so that no measured step loads or compiles a kernel."""
    few = work.descriptions[:FEW_OBJECTS]
    ids = [each.object_id for each in few]
    steps = [(stamp, states[np.isin(states["id"], ids)]) for stamp, states in work.steps[:FEWEST_STEPS]]
    for profile in settings:
        play_steps(Monitor(profile, warns=False), few, steps, lambda done: None)


def fixed_part(work: Workload) -> float:
    """Return the median time (µs) of a step with objects that ignore each other, so that no pair is examined."""
    alone = [replace(each, group=1, mask=2) for each in work.descriptions]
    fast = Monitor(Profile.named("fast"), warns=False)
    played = play_steps(fast, alone, work.steps, lambda done: None, SETTING_SECONDS / 3.0)
    return 1e6 * float(np.median(played.warm()[0]))
