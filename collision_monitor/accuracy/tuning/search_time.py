"""How long `tune` searches: the runs that it needs, and how long each of them may take."""

from __future__ import annotations

import time
from dataclasses import dataclass
from itertools import pairwise
from typing import Final

import numpy as np

from collision_monitor.accuracy.inputs import Workload
from collision_monitor.accuracy.playback import play_steps
from collision_monitor.accuracy.tradeoff.profile_tradeoff import exact_answers
from collision_monitor.accuracy.tuning.candidates import FACTORS, Space
from collision_monitor.accuracy.tuning.halving import FINALISTS, HOPS, ROUNDS, rungs_of
from collision_monitor.accuracy.tuning.parallel_measurement import tiles_of
from collision_monitor.monitor.monitor import Monitor

RUN_SECONDS: Final = 0.4
"""Longest time of the steps of one profile on one tile (s). A slower profile is measured on fewer steps."""
SHORTEST_RUN: Final = 0.1
"""The same, if the search would take longer than LONGEST."""
LONGEST: Final = 45.0
"""Time of a search (s) above which the runs get shorter."""
STARTING: Final = 4.0
"""Time to start the processes and to load the kernels (s)."""
PILOT: Final = 30
"""Steps that are played to estimate the times."""


@dataclass(frozen=True)
class SearchPlan:
    """seconds: estimated time of the search (s). run_seconds: longest time of one profile on one tile (s)."""

    seconds: float
    run_seconds: float


def plan_search(work: Workload, space: Space, jobs: int) -> SearchPlan:
    """Estimate the time of `tune` from PILOT steps, which also load the kernels, and shorten the runs of a long one."""
    steps = work.steps[:PILOT]
    spent = []
    begin = time.perf_counter()
    exact_answers(work.descriptions, steps, space.recorded, lambda done: None)
    truth = (time.perf_counter() - begin) / len(steps)
    begin, own = time.perf_counter(), 0.0
    for profile in space.first_generation():
        if profile.name.partition(",")[0] in ("fast", f"balanced × {FACTORS[4]:g}", "exact"):
            run = play_steps(Monitor(profile, warns=False), work.descriptions, steps, lambda done: None, RUN_SECONDS)
            spent.append(float(np.median(run.warm()[0])))
            own += float(run.seconds.sum())
    describing = (time.perf_counter() - begin - own) / max(len(spent), 1)
    tiles = tiles_of(len(work.steps))
    length, jobs = len(work.steps) / tiles, min(jobs, tiles)
    runs = runs_of(space, tiles, jobs)

    def search_time(run_seconds: float) -> float:
        run = describing + float(np.mean([min(length * each, run_seconds) for each in spent]))
        alone = FINALISTS * ROUNDS * run
        return STARTING + len(work.steps) * min(spent) + alone + (runs * run + len(work.steps) * truth) / jobs

    fits = [each for each in np.linspace(RUN_SECONDS, SHORTEST_RUN, 7) if search_time(each) <= LONGEST]
    run_seconds = float(fits[0]) if fits else SHORTEST_RUN
    return SearchPlan(search_time(run_seconds), run_seconds)


def runs_of(space: Space, tiles: int, jobs: int) -> int:
    """Estimate the number of runs, each of one profile on one tile."""
    rungs, first = rungs_of(tiles, jobs), space.first_generation()
    variations = HOPS * len(space.variations(first[-1])) if first else 0
    steps = [(height, upper - lower) for height, (lower, upper) in enumerate(pairwise(rungs), 1)]
    halves = sum(max(len(first) >> height, FINALISTS) * tiles for height, tiles in steps)
    return (len(first) + variations) * rungs[0] + halves
