"""Search for the cheapest profile that meets a user's demands on a recording, and explain the choice."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, ExitStack
from dataclasses import dataclass
from itertools import pairwise
from typing import Final

import numpy as np
import yaml

from collision_monitor.accuracy.candidates import FACTORS, Space, models_of
from collision_monitor.accuracy.demands import Demands
from collision_monitor.accuracy.halving import FINALISTS, HOPS, RUN_SECONDS, Halving, Trial, rungs_of
from collision_monitor.accuracy.inputs import Workload
from collision_monitor.accuracy.playback import play
from collision_monitor.accuracy.profile_tradeoff import exact_answers
from collision_monitor.accuracy.tiles import Recording, tiles_of, workers
from collision_monitor.monitor.monitor import Monitor
from collision_monitor.settings.parameter_file import PARAMETER_SECTION
from collision_monitor.settings.profile import Profile

TIMING_NOISE: Final = 1.05
"""Times that differ by less than this factor count as equal."""
STARTING: Final = 4.0
"""Time to start the processes and to load the kernels (s)."""
PILOT: Final = 30
"""Steps that are played to estimate the time of the search."""

ProgressBar = Callable[[str, int], AbstractContextManager[Callable[[int], None]]]


@dataclass(frozen=True)
class Tuned:
    """chosen: None if no profile meets the demands. trials: all, cheapest first. reasons: three lines for a person.

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


def tune(work: Workload, space: Space, progress_bar: ProgressBar, jobs: int | None = None) -> Tuned:
    """Search the profiles of the space on a recording, on `jobs` cores (None: all)."""
    recorded = space.recorded
    horizons = sorted({space.horizon, recorded.horizon})
    recording = Recording.cut(work.descriptions, work.steps, recorded, horizons)
    with ExitStack() as stack:
        team = stack.enter_context(workers(recording, jobs))
        progress = stack.enter_context(progress_bar(work.name, _runs(space, recording.tiles, team.jobs)))
        search = Halving(work.name, space, team, progress)
        search.run()
    trials = search.trials()
    chosen = _choice(trials)
    untested = space.demands.untested(chosen.measurement) if chosen else []
    return Tuned(chosen.profile if chosen else None, trials, explain(chosen, trials, space.demands), untested)


def _runs(space: Space, tiles: int, jobs: int) -> int:
    """Estimate the number of runs, each of one profile on one tile."""
    rungs, first = rungs_of(tiles, jobs), space.first_generation()
    variations = HOPS * len(space.variations(first[-1])) if first else 0
    steps = [(height, upper - lower) for height, (lower, upper) in enumerate(pairwise(rungs), 1)]
    halves = sum(max(len(first) >> height, FINALISTS) * tiles for height, tiles in steps)
    return (len(first) + variations) * rungs[0] + halves


def estimate(work: Workload, space: Space, jobs: int) -> float:
    """Estimate the time of `tune` (s) from PILOT steps, which also load the kernels."""
    steps = work.steps[:PILOT]
    spent = []
    for profile in space.first_generation():
        if profile.name.partition(",")[0] in ("fast", f"balanced × {FACTORS[4]:g}", "exact"):
            run = play(Monitor(profile, warns=False), work.descriptions, steps, lambda done: None, RUN_SECONDS)
            spent.append(float(np.median(run.warm()[0])))
    begin = time.perf_counter()
    exact_answers(work.descriptions, steps, space.recorded, lambda done: None)
    truth = (time.perf_counter() - begin) / len(steps)
    tiles = tiles_of(len(work.steps))
    length = len(work.steps) / tiles
    run_time = float(np.mean([min(length * each, RUN_SECONDS) for each in spent]))
    truths = truth * length * tiles * (1 + HOPS)
    jobs = min(jobs, tiles)
    return STARTING + len(work.steps) * min(spent) + (_runs(space, tiles, jobs) * run_time + truths) / jobs


def _choice(trials: list[Trial]) -> Trial | None:
    """Return the cheapest good trial that was timed alone; the most accurate of those that cost the same."""
    good = [each for each in trials if each.timed and not each.failures]
    least = min((each.measurement.step_ms for each in good), default=0.0)
    same = [each for each in good if each.measurement.step_ms <= TIMING_NOISE * least]
    return min(same, key=lambda each: each.error, default=None)


def explain(chosen: Trial | None, trials: list[Trial], demands: Demands) -> list[str]:
    """Return three lines: what was chosen, what a cheaper choice fails, and what a more accurate one costs."""
    if chosen is None:
        nearest = min(trials, key=lambda each: demands.excess(each.measurement))
        safe = [each for each in trials if not each.measurement.misses and not each.measurement.outside_bound]
        finest = min(safe or trials, key=lambda each: each.error)
        return [
            f"none of {len(trials)} profiles meets all demands ({demands})",
            f"nearest: {nearest.profile.name}: {'; '.join(nearest.failures)}",
            f"cheapest: {_figures(trials[0])}; most accurate: {_figures(finest)}",
        ]
    cost = chosen.measurement.step_ms
    cheaper = [each for each in trials if each.failures and each.measurement.step_ms < cost / TIMING_NOISE]
    finer = [each for each in trials if not each.failures and each.error < chosen.error]
    other = _with_other_uncertainty(chosen, trials)
    lines = [f"chosen: {_figures(chosen)}, on {chosen.measurement.steps} steps"]
    if cheaper:
        last = cheaper[-1]
        lines.append(f"cheaper: {last.profile.name} ({last.measurement.step_ms:.3g} ms): {last.failures[0]}")
    else:
        lines.append(f"cheaper: none of the {len(trials)} profiles that were tried")
    if other is not None and not chosen.profile.uncertainty:
        ratio = other.measurement.step_ms / cost
        lines.append(f"dearer: uncertainty on, {ratio:.3g} times the time of a step; no demand needs probabilities")
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


def _with_other_uncertainty(chosen: Trial, trials: list[Trial]) -> Trial | None:
    """Return the trial of the same tolerances with uncertainty on, or None."""
    same = [name for name in chosen.profile.to_dict() if name.endswith("_tolerance")]
    for each in trials:
        if each.profile.uncertainty and all(getattr(each.profile, n) == getattr(chosen.profile, n) for n in same):
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
