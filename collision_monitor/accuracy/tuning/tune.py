"""Search for the cheapest profile that meets a user's demands on a recording, and explain the choice."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, ExitStack
from dataclasses import dataclass, replace
from typing import Final

import yaml

from collision_monitor.accuracy.inputs import Workload
from collision_monitor.accuracy.tuning.candidates import Space, models_of
from collision_monitor.accuracy.tuning.demands import Demands
from collision_monitor.accuracy.tuning.halving import Halving, Trial
from collision_monitor.accuracy.tuning.parallel_measurement import TuningInputs, workers
from collision_monitor.accuracy.tuning.search_time import RUN_SECONDS, runs_of
from collision_monitor.settings.parameter_file import PARAMETER_SECTION
from collision_monitor.settings.profile import Profile

TIMING_NOISE: Final = 1.05
"""Times that differ by less than this factor count as equal."""

ProgressBar = Callable[[str, int], AbstractContextManager[Callable[[int], None]]]


@dataclass(frozen=True)
class Tuned:
    """chosen: None if no profile meets the demands. trials: all, cheapest first. reasons: lines for a person.

    untested: a sentence for each demand that the chosen profile meets only because the recording lacks such answers.
    """

    chosen: Profile | None
    trials: list[Trial]
    reasons: list[str]
    untested: list[str]


def space_of(work: Workload, recorded: Profile, demands: Demands) -> Space:
    """Return what the recording leaves to choose. Raises InputError for demands that contradict it."""
    uncertain = any(
        (states[f"{name}_stddev"] > 0.0).any()
        for _, states in work.steps
        for name in ("position", "orientation", "velocity", "angular_velocity")
    )
    demands.check(recorded, uncertain=uncertain)
    return Space(recorded, demands, uncertain, models_of(work.descriptions))


def tune(
    work: Workload,
    space: Space,
    progress_bar: ProgressBar,
    jobs: int | None = None,
    run_seconds: float = RUN_SECONDS,
) -> Tuned:
    """Search the profiles of the space on a recording, on `jobs` cores (None: all).

    run_seconds: longest time of the steps of one profile on one tile (s); see `plan_search`.
    """
    recorded = space.recorded
    horizons = sorted({space.horizon, recorded.horizon})
    recording = TuningInputs.cut(work.descriptions, work.steps, recorded, horizons)
    with ExitStack() as stack:
        team = stack.enter_context(workers(recording, jobs))
        progress = stack.enter_context(progress_bar(work.name, runs_of(space, recording.tiles, team.jobs)))
        search = Halving(work.name, space, team, run_seconds, progress)
        search.run()
    trials = search.trials()
    chosen = _choice(trials)
    untested = space.demands.untested(chosen.measurement) if chosen else []
    return Tuned(chosen.profile if chosen else None, trials, explain(chosen, trials, space.demands), untested)


def _choice(trials: list[Trial]) -> Trial | None:
    """Return the cheapest good trial that was timed alone; the most accurate of those that cost the same."""
    good = [each for each in trials if each.timed and not each.failures]
    least = min((each.measurement.step_ms for each in good), default=0.0)
    same = [each for each in good if each.measurement.step_ms <= TIMING_NOISE * least]
    return min(same, key=lambda each: each.error, default=None)


def explain(chosen: Trial | None, trials: list[Trial], demands: Demands) -> list[str]:
    """Return lines: what was chosen, what a cheaper choice fails, and what a more accurate one costs.

    If none is good: which demands no profile meets, and why.
    """
    if chosen is None:
        nearest = min(trials, key=lambda each: demands.excess(each.measurement))
        safe = [each for each in trials if not each.measurement.misses and not each.measurement.outside_bound]
        finest = min(safe or trials, key=lambda each: each.error)
        return [
            f"none of {len(trials)} profiles meets all demands ({demands})",
            *(f"no setting helps: {text}" for text in demands.hopeless([each.measurement for each in trials])),
            f"nearest: {nearest.profile.name}: {'; '.join(nearest.failures)}",
            f"cheapest: {_figures(trials[0])}; most accurate: {_figures(finest)}",
        ]
    cost = chosen.measurement.step_ms
    cheaper = [each for each in trials if each.failures and each.measurement.step_ms < cost / TIMING_NOISE]
    finer = [each for each in trials if not each.failures and each.error < chosen.error]
    likely = _cheapest_with_probabilities(trials, demands)
    lines = [f"chosen: {_figures(chosen)}, on {chosen.measurement.steps} steps"]
    if cheaper:
        last = cheaper[-1]
        lines.append(f"cheaper: {last.profile.name} ({last.measurement.step_ms:.3g} ms): {last.failures[0]}")
    else:
        lines.append(f"cheaper: none of the {len(trials)} profiles that were tried")
    if likely is not None and not chosen.profile.uncertainty:
        ratio = likely.measurement.step_ms / cost
        lines.append(f"dearer: probabilities ({likely.profile.name}), {ratio:.2g} times the time; no demand needs them")
    elif finer:
        lines.append(f"dearer: {_figures(finer[-1])}")
    else:
        lines.append("dearer: nothing that was tried is more accurate")
    return lines


def _figures(trial: Trial) -> str:
    row = trial.measurement
    numbers = [f"{row.step_ms:.3g} ms a step"]
    numbers += [] if row.ttc_error_s.p99 != row.ttc_error_s.p99 else [f"TTC error {row.ttc_error_s.p99:.2g} s"]
    numbers += [] if not row.distance_error_m > 0.0 else [f"distance error {row.distance_error_m:.2g} m"]
    return f"{trial.profile.name} ({', '.join(numbers)})"


def _cheapest_with_probabilities(trials: list[Trial], demands: Demands) -> Trial | None:
    """Return the cheapest trial with uncertainty on that meets the demands on the errors, or None."""
    errors = replace(demands, budget_ms=None)
    for each in trials:
        if each.profile.uncertainty and not errors.failures(each.measurement):
            return each
    return None


def parameter_file(profile: Profile, notes: list[str]) -> str:
    """Return a profile as a parameter file for the node, with notes as comments."""
    settings: dict[str, float | int | str] = {"profile": "balanced"}
    base = Profile.named("balanced")
    settings |= {
        each.name: getattr(profile, each.name)
        for each in Profile.fields()
        if getattr(profile, each.name) != getattr(base, each.name)
    }
    text = yaml.safe_dump({PARAMETER_SECTION: {"ros__parameters": settings}}, sort_keys=False)
    return "".join(f"# {note}\n" for note in _lines(notes)) + text


def _lines(notes: list[str]) -> Iterator[str]:
    for note in notes:
        yield from note.splitlines()
