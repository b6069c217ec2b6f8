"""States that wait while a step takes longer than their period: the newest are monitored, outdated ones left out."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from time import monotonic_ns
from typing import Final

import numpy as np

from collision_monitor.codec import ObjectStateArray
from collision_monitor.pipeline.state_intake import ReceivedStates

AT_ONCE: Final = 2_000_000
"""ns: states that follow a step within this time were waiting for its end."""

RECOVERY: Final = 2.0
"""A backlog is worked off, message for message, if that takes at most 1/RECOVERY of the time that it spans."""

LEARNING: Final = 0.2
"""Weight of the last step in the mean duration."""

OUTLIER: Final = 4.0
"""A step counts as at most so many mean steps: a single slow one does not mean that the next ones are slow."""


class Backlog:
    """Chooses among the states that wait. outdated: messages left out so far. mean: duration of a step, s.

    take: returns the next waiting message, or None. most: so many are taken at once at most.
    """

    def __init__(self, take: Callable[[], bytes | None], most: int) -> None:
        self.outdated = 0
        self._take = take
        self._most = most
        self._ended = 0  # ns, of the last step
        self.mean = 0.0  # duration of a step, s

    def choose(self, first: ReceivedStates) -> list[ReceivedStates]:
        """Return the messages to process now, in order: `first`, which has arrived, and those behind it."""
        if monotonic_ns() - self._ended > AT_ONCE:
            return [first]
        waiting = [first]
        while len(waiting) < self._most and (each := self._take()) is not None:
            waiting.append(ReceivedStates.decode(each))
        chosen = without_outdated(waiting, self.mean)
        self.outdated += len(waiting) - len(chosen)
        return chosen

    def end_step(self, began: int, ended: int) -> None:
        """Note when a step began and ended (ns, steady clock)."""
        self._ended = ended
        took = (ended - began) * 1e-9
        self.mean += LEARNING * (min(took, OUTLIER * self.mean) - self.mean) if self.mean else took


def without_outdated(waiting: Sequence[ReceivedStates], step_s: float) -> list[ReceivedStates]:
    """Return the messages without those whose objects all have newer states behind them.

    All of them stay if they can be worked off soon, at step_s (s) for each. Messages that cannot be decoded stay, so
    that they are refused and counted.
    """
    messages = [each.message for each in waiting]
    stamps = [each.stamp_ns for each in messages if each is not None]
    if len(stamps) < 2 or RECOVERY * step_s * len(waiting) * 1e9 <= max(stamps) - min(stamps):
        return list(waiting)
    return [each for k, each in enumerate(waiting) if not _is_outdated(messages[k], messages[k + 1 :])]


def _is_outdated(message: ObjectStateArray | None, later: Sequence[ObjectStateArray | None]) -> bool:
    """Whether each object of the message has a state with a later stamp in a later message of the same frame."""
    if message is None:
        return False
    newer = [each for each in later if each is not None and each.frame_id == message.frame_id]
    ids = [each.states["id"] for each in newer if each.stamp_ns > message.stamp_ns]
    return bool(ids) and bool(np.isin(message.states["id"], np.concatenate(ids)).all())
