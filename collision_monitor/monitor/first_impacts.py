"""Stage 4, first impacts: predict when each candidate pair meets first, on all threads."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from functools import partial
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from collision_monitor.impact.body_impact import Scratch, make_scratch
from collision_monitor.impact.impact_record import IMPACT
from collision_monitor.impact.pair_impacts import ANEW, BOUNDS, WHOLE, predict_pairs
from collision_monitor.impact.tree_impact import FULL, SearchEnd
from collision_monitor.monitor.shared_work import share
from collision_monitor.monitor.state.snapshot import Facts, Snapshot, Stage
from collision_monitor.monitor.step_context import StepContext
from collision_monitor.records import joined

FEWEST_PAIRS_FOR_THREADS: Final = 500
"""Fewer pairs stay on one thread: passing work to another costs as much as predicting some 100 pairs."""

Events = NDArray[np.void]
Pairs = NDArray[Any]


class FirstImpacts(Stage):
    """Predicts pairs. Keeps no state but its threads and the scratch memory of each."""

    CACHES = ("_scratch", "pool")

    def __init__(self, threads: int) -> None:
        self._scratch: list[Scratch] = []
        self.pool: ThreadPoolExecutor | None = None
        self.use_threads(threads)

    def use_threads(self, threads: int) -> None:
        """Use this number of threads from now on."""
        if self.pool is not None:
            self.pool.shutdown()
        self._scratch = [make_scratch() for _ in range(threads)]
        self.pool = ThreadPoolExecutor(threads - 1) if threads > 1 else None

    @property
    def scratch(self) -> Scratch:
        """Scratch memory of the step's own thread."""
        return self._scratch[0]

    def predict(self, step: StepContext, pairs: Pairs) -> Events:
        """First impacts (IMPACT) of pairs (P, 2) of body slots, in their order. Pairs without one are left out."""
        find = partial(_impacts, WHOLE, step.coarse)
        if self.pool is None or len(pairs) < FEWEST_PAIRS_FOR_THREADS:
            events, queries = find(step, pairs, self.scratch)
            step.work.impact_queries += queries
            return events
        # the parts are joined in order, so any number of threads gives the same answer
        parts = share(self.pool, partial(find, step), pairs, self._scratch)
        step.work.impact_queries += sum(queries for _, queries in parts)
        return joined([events for events, _ in parts])

    def bound(self, step: StepContext, pairs: Pairs) -> Events:
        """As `predict`, but with only a bound by the bounding spheres for pairs that are not cheap (`is_cheap`)."""
        return self._find(BOUNDS, step, pairs)

    def refine(self, step: StepContext, bounds: Events) -> Events:
        """First impacts from now on of pairs whose events (IMPACT) are only bounds. Pairs without one are left out."""
        return self._find(ANEW, step, np.stack([bounds["i"], bounds["j"]], axis=1))

    def _find(self, how: int, step: StepContext, pairs: Pairs) -> Events:
        events, queries = _impacts(how, FULL, step, pairs, self.scratch)
        step.work.impact_queries += queries
        return events

    def save(self, snapshot: Snapshot, facts: Facts) -> None:
        """See Stage: there is nothing to save."""

    def restore(self, snapshot: Snapshot, facts: Facts) -> None:
        """See Stage: there is nothing to restore."""


def _impacts(how: int, ending: SearchEnd, step: StepContext, pairs: Pairs, scratch: Scratch) -> tuple[Events, int]:
    """Impacts (IMPACT) of the pairs, in their order, and the number of distance queries; see `predict_pairs`."""
    events, query = np.empty(len(pairs) + 1, IMPACT), step.settings.impact
    n, queries = predict_pairs(step.roster.multibody, pairs, step.now, query, ending, how, events, scratch)
    return events[:n], queries
