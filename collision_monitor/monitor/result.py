"""The result of a step: its answers and its status."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray


@dataclass
class Work:
    """Counters of a step's work, filled by its stages; the fields are those of StepStatus."""

    objects_moved: int = 0
    candidate_pairs: int = 0
    narrow_phase_tests: int = 0
    impact_queries: int = 0
    events_due: int = 0
    deferred: int = 0


@dataclass(frozen=True)
class StepStatus:
    """Counts of objects, answers and work in a step; the fields are those of MonitorStatus.msg."""

    objects: int
    objects_static: int
    objects_unseen: int
    objects_stale: int
    contacts: int
    predictions: int
    unresolved: int
    objects_moved: int
    candidate_pairs: int
    narrow_phase_tests: int
    impact_queries: int
    events_due: int
    events_pending: int
    deferred: int


@dataclass(frozen=True, eq=False)
class StepResult:
    """The answers of one step: `contacts` (records.CONTACT) by ids, `predictions` (records.PREDICTION) soonest first.

    If the profile's `contact_points` is larger than 1, a contact has `point_count` rows, numbered by `point_index`.

    accepted: False if the step was refused because of its stamp; the answers are then those of the last accepted step.
    cut: number of pairs that were examined before the budget ran out; None: all pairs were examined.
    """

    stamp_ns: int
    step: int
    contacts: NDArray[np.void]
    predictions: NDArray[np.void]
    status: StepStatus
    accepted: bool = True
    cut: int | None = None
