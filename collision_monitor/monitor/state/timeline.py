"""The monitor's timeline: stamps to seconds. A stamp that jumps, or time that goes back, needs a second message."""

from __future__ import annotations

from enum import Enum
from typing import Final

from collision_monitor.monitor.state.snapshot import Facts, Snapshot, Stage, whole_fact

NANOSECOND: Final = 1e-9

MOST_JUMPS: Final = 64
"""Refused stamps that a later message may confirm: one for each publisher, if their clocks do not agree either."""


class Order(Enum):
    """How a message's stamp stands to the states that the monitor has."""

    IN_ORDER = 0  # not behind the latest time, or by little; or it names no moving object
    LATE = 1  # the latest time is so far ahead of it that its states are stale on arrival
    OLD = 2  # at least one of its objects has a newer state


class Progress(Enum):
    """How a stamp continues the timeline."""

    CONTINUES = 0
    RESTARTS = 1  # a second message confirmed the jump: all earlier times are void
    REFUSED = 2  # the stamp jumps, and no second message has confirmed the jump yet


class Timeline(Stage):
    """The latest time so far, in nanoseconds and in seconds after the origin, which is the first stamp.

    What speaks for another time counts only until the latest time advances: then a publisher goes on as before, and
    the objects without newer states age. restarts: number of times that a jump was confirmed.
    """

    SAVED = ("_origin_ns", "now_ns", "restarts", "_jumps", "_old_ns", "_late_ns")

    def __init__(self) -> None:
        self._origin_ns: int | None = None
        self.now_ns = 0
        self.restarts = 0
        self._doubt_nothing()

    def _doubt_nothing(self) -> None:
        self._jumps: list[int] = []  # stamps of the last refused messages
        self._old_ns: int | None = None  # stamp of the last OLD message
        self._late_ns: tuple[int, int] | None = None  # first and last stamp of the LATE messages

    def seconds(self, stamp_ns: int) -> float:
        """Convert a stamp to seconds after the origin."""
        assert self._origin_ns is not None
        return (stamp_ns - self._origin_ns) * NANOSECOND

    @property
    def now(self) -> float:
        """The latest time (s after the origin)."""
        return self.seconds(self.now_ns)

    def age(self, now_ns: int | None, most: float) -> float:
        """Age (s) of the latest states at `now_ns`; 0 if it is not known, or the age would not be from 0 to `most`."""
        age = (now_ns - self.now_ns) * NANOSECOND if now_ns is not None else 0.0
        return age if 0.0 <= age <= most else 0.0

    @property
    def has_begun(self) -> bool:
        """Whether there is a latest time."""
        return self._origin_ns is not None

    def is_behind(self, stamp_ns: int) -> bool:
        """Whether the stamp is older than the latest time."""
        return self.has_begun and stamp_ns < self.now_ns

    def advance(self, stamp_ns: int, order: Order, max_time_step: float, patience: float) -> Progress:
        """Move the latest time to the stamp, unless it is older by at most max_time_step (s).

        Time jumped, and restarts at the stamp, if the stamp is at most max_time_step later than another one that

        - is more than max_time_step (s) away from the latest time, like this one, or
        - belongs to an OLD message, like this one. One OLD message alone can be late or a duplicate.

        The same holds if stamps of LATE messages cover more than `patience` (s): the publisher that was ahead of them
        has been silent for that long.
        """
        if self._origin_ns is None:
            self._begin(stamp_ns)
            return Progress.CONTINUES
        limit = int(max_time_step / NANOSECOND)
        if abs(stamp_ns - self.now_ns) > limit:
            jumped = any(0 < stamp_ns - jump <= limit for jump in self._jumps)
            self._jumps = [*self._jumps[1 - MOST_JUMPS :], stamp_ns]
            return self._restart(stamp_ns) if jumped else Progress.REFUSED
        if stamp_ns > self.now_ns:
            self.now_ns = stamp_ns
            self._doubt_nothing()
        elif self._went_back(stamp_ns, order, round(patience / NANOSECOND)):
            return self._restart(stamp_ns)
        return Progress.CONTINUES

    def _went_back(self, stamp_ns: int, order: Order, patience: int) -> bool:
        if order is Order.OLD:
            agrees = self._old_ns is not None and stamp_ns > self._old_ns
            self._old_ns = stamp_ns
            return agrees
        if order is Order.LATE:
            first, last = self._late_ns or (stamp_ns, stamp_ns)
            if stamp_ns > last + patience:  # of another publisher, less far behind
                first = stamp_ns
            self._late_ns = first, max(last, stamp_ns)
            return stamp_ns - first > patience
        return False

    def _restart(self, stamp_ns: int) -> Progress:
        self._begin(stamp_ns)
        self.restarts += 1
        return Progress.RESTARTS

    def _begin(self, stamp_ns: int) -> None:
        self._origin_ns = self.now_ns = stamp_ns
        self._doubt_nothing()

    def save(self, snapshot: Snapshot, facts: Facts) -> None:
        """See Stage."""
        facts |= {"origin_ns": self._origin_ns, "now_ns": self.now_ns, "restarts": self.restarts}
        facts |= {"jumps": self._jumps, "old_ns": self._old_ns, "late_ns": self._late_ns}

    def restore(self, snapshot: Snapshot, facts: Facts) -> None:
        """See Stage."""
        origin, old, late = facts["origin_ns"], facts["old_ns"], facts["late_ns"]
        self._origin_ns = None if origin is None else whole_fact(origin, "origin_ns")
        self.now_ns, self.restarts = whole_fact(facts["now_ns"], "now_ns"), whole_fact(facts["restarts"], "restarts")
        self._jumps = [whole_fact(stamp, "jumps") for stamp in facts["jumps"]][-MOST_JUMPS:]
        self._old_ns = None if old is None else whole_fact(old, "old_ns")
        self._late_ns = None
        if late is not None:
            first, last = late
            self._late_ns = whole_fact(first, "late_ns"), whole_fact(last, "late_ns")
