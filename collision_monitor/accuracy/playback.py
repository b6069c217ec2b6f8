"""Answers of a monitor to a sequence of steps, with the time of each step."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from math import inf
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from collision_monitor.monitor.monitor import Monitor
from collision_monitor.monitor.result import StepResult
from collision_monitor.objects.description import ObjectDescription

Step = tuple[int, NDArray[np.void]]
"""Stamp (ns) and states (records.STATE)."""


FEWEST_STEPS: Final = 2
"""Steps of a run that its time cannot cut: the first one initialises everything."""


@dataclass(frozen=True)
class Played:
    """Answer of a monitor and duration (s) of each step."""

    answers: list[StepResult]
    seconds: NDArray[np.float64]

    def warm(self) -> tuple[NDArray[np.float64], int]:
        """Return the times (s) of the steps and the pairs that they examined or predicted.

        Without the first step, which initialises everything.
        """
        warm = self.seconds[1:] if len(self.seconds) > 1 else self.seconds
        pairs = sum(a.status.narrow_phase_tests + a.status.impact_queries for a in self.answers[1:] or self.answers)
        return warm, pairs

    def cost(self) -> dict[str, Any]:
        """Return the times of a Measurement."""
        warm, pairs = self.warm()
        return {
            "step_ms": 1e3 * float(np.median(warm)),
            "step_ms_p99": 1e3 * float(np.percentile(warm, 99)),
            "pair_us": 1e6 * float(warm.sum()) / pairs if pairs else np.nan,
        }


def play_steps(
    monitor: Monitor,
    described: Iterable[ObjectDescription],
    steps: Sequence[Step],
    progress: Callable[[int], None],
    most_seconds: float = inf,
) -> Played:
    """Describe all objects to a monitor, then run all steps. progress: called with 1 after each step.

    most_seconds: time of the steps after which the others are left out, but at least FEWEST_STEPS are run.
    """
    for description in described:
        monitor.describe(description)
    answers, seconds, left = [], np.empty(len(steps)), most_seconds
    for k, (stamp, states) in enumerate(steps):
        if left < 0.0 and k >= FEWEST_STEPS:
            progress(len(steps) - k)
            break
        begin = time.perf_counter()
        answers.append(monitor.step(stamp, states))
        seconds[k] = time.perf_counter() - begin
        left -= seconds[k]
        progress(1)
    return Played(answers, seconds[: len(answers)])


def by_pair(answers: NDArray[np.void]) -> dict[tuple[int, int], Any]:
    """Return the rows of contacts or predictions by the ids of their pair."""
    return {(int(answer["id_a"]), int(answer["id_b"])): answer for answer in answers}


def contacts_by_pair(answer: StepResult) -> dict[tuple[int, int], Any]:
    """Return the row with the distance of each pair in contact or within the contact margin."""
    rows = answer.contacts
    return by_pair(rows.compress(rows["point_index"] == 0))
