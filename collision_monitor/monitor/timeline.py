"""The monitor's timeline: stamps to seconds. A stamp that jumps has to be confirmed by a second message."""

from __future__ import annotations

from enum import Enum
from typing import Final

from collision_monitor.monitor.snapshot import Facts, Snapshot, Stage

NANOSECOND: Final = 1e-9


class Progress(Enum):
    """How a stamp continues the timeline."""

    CONTINUES = 0
    RESTARTS = 1  # a second message confirmed the jump: all earlier times are void
    REFUSED = 2  # the stamp jumps, and no second message has confirmed the jump yet


class Timeline(Stage):
    """The latest time so far, in nanoseconds and in seconds after the origin, which is the first stamp."""

    SAVED = ("_origin_ns", "now_ns", "_jump_ns")

    def __init__(self) -> None:
        self._origin_ns: int | None = None
        self.now_ns = 0
        self._jump_ns: int | None = None  # a refused stamp; the next message may confirm it

    def seconds(self, stamp_ns: int) -> float:
        """Convert a stamp to seconds after the origin."""
        assert self._origin_ns is not None
        return (stamp_ns - self._origin_ns) * NANOSECOND

    @property
    def now(self) -> float:
        """The latest time (s after the origin)."""
        return self.seconds(self.now_ns)

    def forget(self) -> None:
        """Accept any next stamp as the new origin."""
        self._origin_ns = None

    def advance(self, stamp_ns: int, max_time_step: float) -> Progress:
        """Move the latest time to the stamp. A stamp that is older by at most max_time_step (s) does not change it."""
        if self._origin_ns is None:
            self._begin(stamp_ns)
            return Progress.CONTINUES
        limit = int(max_time_step / NANOSECOND)
        if abs(stamp_ns - self.now_ns) <= limit:
            self.now_ns = max(self.now_ns, stamp_ns)
            self._jump_ns = None
            return Progress.CONTINUES
        if self._jump_ns is not None and abs(stamp_ns - self._jump_ns) <= limit:
            self._begin(stamp_ns)
            return Progress.RESTARTS
        self._jump_ns = stamp_ns
        return Progress.REFUSED

    def _begin(self, stamp_ns: int) -> None:
        self._origin_ns = self.now_ns = stamp_ns
        self._jump_ns = None

    def save(self, snapshot: Snapshot, facts: Facts) -> None:
        """See Stage."""
        facts |= {"origin_ns": self._origin_ns, "now_ns": self.now_ns, "jump_ns": self._jump_ns}

    def restore(self, snapshot: Snapshot, facts: Facts) -> None:
        """See Stage."""
        self._origin_ns, self.now_ns, self._jump_ns = facts["origin_ns"], facts["now_ns"], facts["jump_ns"]
