"""How much a step may still do, counted in pairs.

Against the clock, so that a step ends in time; and by a number, so that a replay stops where the recorded step stopped.
The clock decides only how many pairs are looked at; which ones, and what is said of the others, is decided without it.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from time import perf_counter
from typing import Final, Self

FEWEST: Final = 8
"""Pairs in a step at least, so that what is left is settled in the end."""

WORTH_A_LOOK: Final = 5e-5
"""Work (s) between two looks at the clock, at least; or a pair."""

LEARNING: Final = 0.2
"""Weight of the latest measurement in the running means; that of a pair's cost rises at once and falls slowly."""

SPREAD: Final = 4.0
"""Mean deviations that the end of a step may take longer than usual."""

OUTLIER: Final = 4.0
"""A time that is this many times the usual one counts as that: the machine was busy with something else."""

EXAMINE, REFINE, TREES = 0, 1, 2
"""What is done to a pair: looked at now, its first impact sought, or to a handful of pairs: when their trees meet."""

HANDFUL: Final = 8
"""Pairs of sphere trees that cost about as much as one pair of shapes, and count as one."""


class PairBudget:
    """So many pairs and no more. `done`: how many were handed out."""

    def __init__(self, limit: int) -> None:
        self.done = 0
        self._limit = limit

    def next(self, left: int, work: int) -> int:
        """How many of the pairs that are left to do now; 0: stop. work: EXAMINE or REFINE."""
        del work
        count = min(left, self._limit - self.done)
        self.done += count
        return count

    def stop(self) -> None:
        """No more will be asked for."""


class StepClock:
    """The steady clock of one monitor's steps; a context, entered by whoever hands a step's answers on.

    It learns what a pair costs, and what a step still takes once no more pairs are looked at.
    """

    def __init__(self) -> None:
        self.cost = [1e-5, 1e-5, 1e-5]  # s for a pair, by kind of work
        self.began = self.stopped = 0.0
        self._end = self._deviation = self._aside = 0.0  # s
        self._depth = 0

    def __enter__(self) -> Self:
        """Entered again within a step, it goes on."""
        if self._depth == 0:
            self.began, self.stopped, self._aside = perf_counter(), 0.0, 0.0
        self._depth += 1
        return self

    @contextmanager
    def aside(self) -> Iterator[None]:
        """What is done meanwhile comes on top of the budget: no time is reserved for it."""
        began = perf_counter()
        yield
        self._aside += perf_counter() - began

    def __exit__(self, *_: object) -> None:
        self._depth -= 1
        if self._depth == 0 and self.stopped:
            took = perf_counter() - self.stopped - self._aside
            if self._end:
                took = min(took, OUTLIER * (self._end + self._deviation))
            else:
                self._end = took
            self._deviation += LEARNING * (abs(took - self._end) - self._deviation)
            self._end += LEARNING * (took - self._end)

    @property
    def reserve(self) -> float:
        """s to be left for the end of a step."""
        return self._end + SPREAD * self._deviation


class TimeBudget(PairBudget):
    """As many pairs as fit into `seconds` from the step's begin on, but FEWEST in any case, so that work goes on."""

    def __init__(self, clock: StepClock, seconds: float, limit: int) -> None:
        super().__init__(limit)
        self._clock = clock
        self._deadline = clock.began + seconds - clock.reserve
        self._out = (0, 0, 0.0)  # the pairs that are being done: how many, what work, since when

    def next(self, left: int, work: int) -> int:
        """See PairBudget. About half of what seems to fit: so the estimate is checked on the way."""
        now = self._measure()
        cost = self._clock.cost[work]
        fit = int((self._deadline - now) / cost)
        if fit < 1:
            if now < self._deadline:
                self._clock.cost[work] *= 1.0 - LEARNING  # or one bad estimate would stop all steps to come
            self._limit = min(self._limit, max(self.done, FEWEST))  # the step is over
            self._clock.stopped = self._clock.stopped or now
            return super().next(left, work)
        count = super().next(min(left, fit, max(fit // 2, 1 + int(WORTH_A_LOOK / cost))), work)
        self._out = (count, work, now)
        return count

    def stop(self) -> None:
        """What comes now is the end of the step."""
        self._clock.stopped = self._clock.stopped or self._measure()

    def _measure(self) -> float:
        now = perf_counter()
        count, work, since = self._out
        if count:
            cost = self._clock.cost
            measured = min((now - since) / count, OUTLIER * cost[work])
            cost[work] += (LEARNING if measured < cost[work] else 1.0) * (measured - cost[work])
        self._out = (0, 0, 0.0)
        return now
