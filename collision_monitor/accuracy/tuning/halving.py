"""Successive halving: measure many profiles on little of a recording, and the better half on twice as much."""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from numpy.typing import NDArray

from collision_monitor.accuracy.playback import play_steps
from collision_monitor.accuracy.tradeoff.measurement import Measurement
from collision_monitor.accuracy.tuning.candidates import Space, with_threads
from collision_monitor.accuracy.tuning.parallel_measurement import Workers
from collision_monitor.accuracy.tuning.tally import Tally
from collision_monitor.monitor.monitor import Monitor
from collision_monitor.settings.profile import NO_BUDGET, Profile

HOPS: Final = 2
"""How often the best profile is varied, so that it may differ along two axes more than the first generation."""
FINALISTS: Final = 3
"""Profiles that the last rung measures on all tiles, and then alone."""
ROUNDS: Final = 3
"""Runs of each finalist, alone and in turns, that measure its time."""

Progress = Callable[[int], None]


@dataclass(frozen=True)
class Trial:
    """Measurement of one profile on `tiles` tiles. failures: demands that it does not meet."""

    profile: Profile
    measurement: Measurement
    failures: list[str]
    tiles: int
    timed: bool
    """Whether its step times are those of runs alone; else all cores were at work."""

    @property
    def error(self) -> tuple[float, float]:
        """Its errors, for sorting; NaN, without answers, counts as none."""
        time, distance = self.measurement.ttc_error_s.p99, self.measurement.distance_error_m
        return (0.0 if time != time else time, 0.0 if distance != distance else distance)


class Halving:
    """The tallies of all profiles measured so far, on the tiles of a recording."""

    def __init__(self, name: str, space: Space, team: Workers, run_seconds: float, progress: Progress) -> None:
        """run_seconds: longest time of the steps of one profile on one tile (s)."""
        self._name, self._space, self._team, self._progress = name, space, team, progress
        self._run_seconds = run_seconds
        self._tallies: dict[Profile, Tally] = {}
        self._tiles: dict[Profile, int] = {}
        self._alone: dict[Profile, NDArray[np.float64]] = {}
        self._order = team.recording.spread()

    def run(self) -> None:
        """Measure the first generation, its variations, the better halves, and the finalists until one is good.

        If all are too slow, the fastest one is timed with more threads.
        """
        rungs = rungs_of(self._team.recording.tiles, self._team.jobs)
        first = self._space.first_generation()
        self.measure(first, rungs[0])
        for _ in range(HOPS):
            best = self.best(1)[0]
            self.measure([each for each in self._space.variations(best) if each not in self._tiles], rungs[0])
        for height, tiles in enumerate(rungs[1:-1], 1):
            self.measure(self.best(max(len(first) >> height, FINALISTS)), tiles)
        while finalists := [each for each in self.best(FINALISTS) if each not in self._alone]:
            self.measure(finalists, rungs[-1])
            self.time_alone(finalists)
            if any(each.timed and not each.failures for each in self.trials()):
                return
        self._time_with_threads()

    def _time_with_threads(self) -> None:
        """Time the fastest of the profiles that are good but too slow with more threads, which change no answer."""
        demands = replace(self._space.demands, budget_ms=None)
        slow = [each for each in self.trials() if each.timed and not demands.failures(each.measurement)]
        slow = [each for each in slow if each.profile.budget_ms == NO_BUDGET]
        for trial in sorted(slow, key=lambda each: each.measurement.step_ms_p99)[:1]:
            more = with_threads(trial.profile, len(os.sched_getaffinity(0)))
            for each in more:
                self._tallies[each], self._tiles[each] = self._tallies[trial.profile], trial.tiles
            self.time_alone(more)

    def measure(self, profiles: Sequence[Profile], tiles: int) -> None:
        """Measure each profile on those of the first tiles that it lacks."""
        for have in sorted({self._tiles.get(each, 0) for each in profiles}):
            group = [each for each in profiles if self._tiles.get(each, 0) == have < tiles]
            if not group:
                continue
            parts = self._team.measure(self._order[have:tiles], group, self._run_seconds, self._progress)
            for profile, part in zip(group, parts, strict=True):
                self._tallies[profile] = self._tallies.get(profile, Tally()) + part
                self._tiles[profile] = tiles

    def time_alone(self, profiles: Sequence[Profile]) -> None:
        """Time the profiles in turns on one tile in this process, while the others rest.

        The time of a step is its shortest one of all rounds, because other programs only add time.
        """
        recording = self._team.recording
        described, steps = recording.described, recording.steps_of(self._order[0])
        runs: dict[Profile, list[NDArray[np.float64]]] = {each: [] for each in profiles}
        for profile in list(profiles) * ROUNDS:
            played = play_steps(Monitor(profile, warns=False), described, steps, lambda done: None, self._run_seconds)
            runs[profile].append(played.warm()[0])
        for profile, found in runs.items():
            fewest = min(map(len, found))
            self._alone[profile] = np.min([each[:fewest] for each in found], axis=0)

    def trials(self) -> list[Trial]:
        """Return all trials, cheapest first."""
        found = []
        for profile, tally in self._tallies.items():
            timed = profile in self._alone
            tally = replace(tally, seconds=self._alone[profile]) if timed else tally
            row = tally.measurement(self._name, profile, len(self._team.recording.described))
            failures = self._space.demands.failures(row, median=not timed)
            found.append(Trial(profile, row, failures, self._tiles[profile], timed))
        return sorted(found, key=lambda each: each.measurement.step_ms)

    def excess(self, trial: Trial) -> float:
        """Return the largest factor by which a trial exceeds a demand."""
        return self._space.demands.excess(trial.measurement)

    def best(self, count: int) -> list[Profile]:
        """Return the cheapest profiles that meet the demands, the most accurate of these in the last place.

        Without such a profile: those that exceed the demands least.
        """
        trials = self.trials()
        good = [each for each in trials if not each.failures]
        if not good:
            return [each.profile for each in sorted(trials, key=self.excess)[:count]]
        accurate = min(good, key=lambda each: each.error)
        cheap = good[:count] if count == 1 or accurate in good[:count] else [*good[: count - 1], accurate]
        return [each.profile for each in cheap]


def rungs_of(tiles: int, jobs: int) -> list[int]:
    """Return the tiles of each rung: one for each process, then twice as many, in the end all."""
    found = [min(jobs, tiles)]
    while 2 * found[-1] < tiles:
        found.append(2 * found[-1])
    return [*found, tiles]
