"""Measure profiles on parts of a recording, on all cores.

A recording is cut into tiles of consecutive steps. A process measures some profiles on one tile at a time; the exact
answers to the tile are computed once for all of them, and kept for the next ones.
"""

from __future__ import annotations

import os
from collections.abc import Iterator, Sequence
from concurrent.futures import Executor, Future, ProcessPoolExecutor, wait
from contextlib import contextmanager
from dataclasses import dataclass, field
from multiprocessing import get_context
from typing import Any, Final, Self

import numpy as np

from collision_monitor.accuracy.playback import Step, play_steps
from collision_monitor.accuracy.reported import Reported
from collision_monitor.accuracy.scope import compared
from collision_monitor.accuracy.tradeoff.profile_tradeoff import Progress, contacts_of, exact_answers, measure_profile
from collision_monitor.accuracy.tuning.tally import Tally
from collision_monitor.monitor.monitor import Monitor
from collision_monitor.objects.description import ObjectDescription
from collision_monitor.session.history.alarms import CertainContacts
from collision_monitor.session.worker import begin_worker
from collision_monitor.settings.profile import Profile

TILES: Final = 16
"""Tiles of a recording, at most."""
SHORTEST: Final = 25
"""Fewest steps of a tile. Its first step initialises everything and does not count."""
MOST_TRUTHS: Final = 4
"""A process keeps the exact answers to this many tiles, because the first generations of profiles share their tiles."""
POLL: Final = 0.2
"""Time between two looks at the progress of the processes (s)."""


@dataclass(frozen=True)
class TuningInputs:
    """What a process needs: the objects, the steps, the first step of each tile, and the contacts of all steps."""

    described: list[ObjectDescription]
    steps: list[Step]
    begins: list[int]
    contacts: dict[float, CertainContacts]
    """By the horizon (s) that judges alarms."""
    _truths: dict[tuple[Any, ...], Reported] = field(default_factory=dict, init=False, compare=False)

    @classmethod
    def cut(
        cls, described: list[ObjectDescription], steps: list[Step], profile: Profile, horizons: Sequence[float]
    ) -> Self:
        """Cut steps into tiles, and find all their contacts, which takes one run without predictions.

        profile: recorded one, whose contact margin and region apply.
        """
        begins = np.linspace(0, len(steps), tiles_of(len(steps)) + 1).astype(int).tolist()
        none = {"horizon": 0.0, "horizon_by_name": "", "uncertainty": False}
        plain = Profile(name="contacts", **compared(profile) | none)
        truth = Reported.of(play_steps(Monitor(plain, warns=False), described, steps, lambda done: None).answers)
        return cls(described, steps, begins, {each: contacts_of(steps, truth, each) for each in horizons})

    @property
    def tiles(self) -> int:
        """Number of tiles."""
        return len(self.begins) - 1

    def steps_of(self, tile: int) -> list[Step]:
        """Return the steps of a tile."""
        return self.steps[self.begins[tile] : self.begins[tile + 1]]

    def spread(self) -> list[int]:
        """Return the tiles in an order in which the first few are spread over the recording."""
        return sorted(range(self.tiles), key=lambda k: (k * 0.6180339887498949) % 1.0)

    def measure(self, tile: int, profiles: Sequence[Profile], most_seconds: float, progress: Progress) -> list[Tally]:
        """Measure profiles on a tile, most_seconds (s) of steps of each. progress: called after each profile."""
        first, steps = self.begins[tile], self.steps_of(tile)
        found = []
        for profile in profiles:
            truth, contacts = self._truth(tile, profile), self.contacts[profile.horizon]
            found.append(
                measure_profile(self.described, steps, profile, truth, contacts, first=first, most_seconds=most_seconds)
            )
            progress(1)
        return found

    def _truth(self, tile: int, profile: Profile) -> Reported:
        """Return the exact answers to a tile. The last few are kept."""
        truths, key = self._truths, (tile, *compared(profile).values())
        truth = truths.pop(key, None)
        if truth is None:
            truth, _ = exact_answers(self.described, self.steps_of(tile), profile, lambda done: None)
        truths[key] = truth
        if len(truths) > MOST_TRUTHS:
            del truths[next(iter(truths))]  # the one that was used longest ago
        return truth


def tiles_of(steps: int) -> int:
    """Return the number of tiles of so many steps."""
    return max(min(TILES, steps // SHORTEST), 1)


class Workers:
    """Processes that measure profiles on tiles. With one job the work runs in this process."""

    def __init__(self, recording: TuningInputs, jobs: int, pool: Executor | None, done: Any) -> None:
        self.recording, self.jobs = recording, jobs
        self._pool, self._done = pool, done

    def measure(
        self, tiles: Sequence[int], profiles: Sequence[Profile], most_seconds: float, progress: Progress
    ) -> list[Tally]:
        """Return the sum over the tiles of each profile. progress: called with the number of runs just done."""
        if self._pool is None:
            parts = [self.recording.measure(tile, profiles, most_seconds, progress) for tile in tiles]
        else:
            futures = [self._pool.submit(_measure, tile, list(profiles), most_seconds) for tile in tiles]
            self._watch(futures, progress)
            parts = [each.result() for each in futures]
        return [sum(each, Tally()) for each in zip(*parts, strict=True)]

    def _watch(self, futures: Sequence[Future[list[Tally]]], progress: Progress) -> None:
        before, waiting = self._done.value, set(futures)
        while waiting:
            _, waiting = wait(waiting, POLL)
            now = self._done.value
            progress(now - before)
            before = now


@contextmanager
def workers(recording: TuningInputs, jobs: int | None = None) -> Iterator[Workers]:
    """Start processes that have the recording: one for each core, but not more than tiles."""
    jobs = min(jobs or len(os.sched_getaffinity(0)), recording.tiles)
    if jobs <= 1:
        yield Workers(recording, 1, None, None)
        return
    context = get_context("spawn")  # a fork of a process with threads may deadlock
    done = context.Value("q", 0)
    pool = ProcessPoolExecutor(jobs, mp_context=context, initializer=_take, initargs=(recording, done))
    try:
        yield Workers(recording, jobs, pool, done)
    finally:
        pool.shutdown(cancel_futures=True)


_taken: dict[str, Any] = {}


def _take(recording: TuningInputs, done: Any) -> None:
    begin_worker()
    _taken.update(recording=recording, done=done)


def _measure(tile: int, profiles: list[Profile], most_seconds: float) -> list[Tally]:
    def progress(count: int) -> None:
        with _taken["done"].get_lock():
            _taken["done"].value += count

    found: list[Tally] = _taken["recording"].measure(tile, profiles, most_seconds, progress)
    return found
