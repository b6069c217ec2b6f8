"""Budgets of a step, counted in pairs: by the clock or by number.

With a budget in time, a step ends in time. With a number of pairs, a replay stops where the recorded step stopped. The
clock decides only how many pairs a step examines. Their order, and the answers for the others, do not depend on it.
"""

from __future__ import annotations

from time import perf_counter
from typing import Final, Self

FEWEST: Final = 8
"""Smallest number of pairs in a step, so that all pairs are examined in the end."""

WORTH_A_LOOK: Final = 5e-5
"""Least work between two readings of the clock (s); it is at least one pair."""

LEARNING: Final = 0.2
"""Weight of the latest measurement in the running means. The cost of a pair rises at once and falls by this weight."""

SPREAD: Final = 4.0
"""Reserve for the end of a step, beyond its mean duration, in mean deviations."""

OUTLIER: Final = 4.0
"""A measured time is clipped to this many times the usual one: the machine was busy with something else."""

EXAMINE, REFINE, TREES, SAMPLE = 0, 1, 2, 3
"""Kinds of work: examine a pair now, search for its first impact, compare a HANDFUL of pairs of sphere trees, or
compute the probability of an uncertain pair."""

HANDFUL: Final = 8
"""Number of pairs of sphere trees that cost about as much as one pair of shapes, and count as one pair."""


class PairBudget:
    """A budget of `limit` pairs. `done`: number of pairs granted so far."""

    def __init__(self, limit: int) -> None:
        self.done = 0
        self._limit = limit

    def next(self, left: int, work: int) -> int:
        """Return how many of the remaining `left` pairs to do next; 0: stop. work: EXAMINE, REFINE, TREES or SAMPLE."""
        del work
        count = min(left, self._limit - self.done)
        self.done += count
        return count

    def stop(self) -> None:
        """End the budgeted part of the step."""


class StepClock:
    """The steady clock of one monitor's steps: a context, which is entered once for each step.

    It learns the cost of a pair, and the duration of the rest of a step after the last pair.
    """

    def __init__(self) -> None:
        self.cost = [1e-5, 1e-5, 1e-5, 1e-4]  # estimated time for a pair (s), by kind of work
        self.began = self.stopped = 0.0
        self._end = self._deviation = 0.0  # s

    def __enter__(self) -> Self:
        """Start the clock."""
        self.began, self.stopped = perf_counter(), 0.0
        return self

    def __exit__(self, *_: object) -> None:
        if self.stopped:
            took = perf_counter() - self.stopped
            if self._end:
                took = min(took, OUTLIER * (self._end + self._deviation))
            else:
                self._end = took
            self._deviation += LEARNING * (abs(took - self._end) - self._deviation)
            self._end += LEARNING * (took - self._end)

    @property
    def reserve(self) -> float:
        """Time to reserve for the end of a step (s)."""
        return self._end + SPREAD * self._deviation


class TimeBudget(PairBudget):
    """As many pairs as fit into `seconds` from the begin of the step, but at least FEWEST and at most `limit`."""

    def __init__(self, clock: StepClock, seconds: float, limit: int) -> None:
        super().__init__(limit)
        self._clock = clock
        self._deadline = clock.began + seconds - clock.reserve
        self._out = (0, 0, 0.0)  # the pairs granted last: number, kind of work, start time

    def next(self, left: int, work: int) -> int:
        """See PairBudget. Grants about half of the pairs that seem to fit, to correct the estimate on the way."""
        now = self._measure()
        cost = self._clock.cost[work]
        fit = int((self._deadline - now) / cost)
        if fit < 1:
            if now < self._deadline:
                self._clock.cost[work] *= 1.0 - LEARNING  # else one bad estimate would stop all later steps
            self._limit = min(self._limit, max(self.done, FEWEST))  # grant no more in this step
            self._clock.stopped = self._clock.stopped or now
            return super().next(left, work)
        count = super().next(min(left, fit, max(fit // 2, 1 + int(WORTH_A_LOOK / cost))), work)
        self._out = (count, work, now)
        return count

    def stop(self) -> None:
        """Mark the begin of the end of the step, which `StepClock.reserve` estimates."""
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
