"""Threads in small scenes: limits so low that a handful of pairs is shared, and proof that threads worked."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from typing import Any

import pytest

from collision_monitor.monitor import first_impacts, uncertain_predictions
from collision_monitor.monitor.shared_work import share

FEWEST = 2
"""Pairs that are shared, in place of hundreds."""


class StartedThreads:
    """Counts the threads that computed a part of the work. most: so many did at once; 0: nothing was shared."""

    def __init__(self) -> None:
        self.most = 0

    def share(self, pool: ThreadPoolExecutor, part: Callable[..., Any], rows: Any, scratch: Sequence[Any]) -> list[Any]:
        used: set[int] = set()

        def noted(some: Any, work: Any) -> Any:
            if len(some):
                used.add(threading.get_ident())
            return part(some, work)

        answers = share(pool, noted, rows, scratch)
        self.most = max(self.most, len(used))
        return answers


@contextmanager
def threads_start() -> Iterator[StartedThreads]:
    """Let monitors with several threads use them in the smallest scenes, and count those that did."""
    started = StartedThreads()
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(first_impacts, "FEWEST_PAIRS_FOR_THREADS", FEWEST)
        patch.setattr(uncertain_predictions, "FEWEST_SAMPLED_PAIRS_FOR_THREADS", FEWEST)
        for module in (first_impacts, uncertain_predictions):
            patch.setattr(module, "share", started.share)
        yield started
