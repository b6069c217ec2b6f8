"""The result of a replay."""

from __future__ import annotations

from dataclasses import dataclass, field
from enum import IntEnum

from collision_monitor.session.replaying.difference import Difference


class Verdict(IntEnum):
    """The verdict of a replay. The values are the exit codes of `collision-monitor replay`."""

    IDENTICAL = 0
    DIVERGED = 3
    NOT_COMPARABLE = 4


@dataclass
class ReplayReport:
    """The result of a replay. Durations in s; digest: of all answers of the replay.

    begin: s after the session's first message. foreign: another program recorded it. hole: messages are missing, and
    nothing behind them could be compared up to the next snapshot. late: the session begins after its monitor and does
    not hold the monitor's state then, so up to the first snapshot the answers are computed anew and not compared.
    within: number of answers whose bytes differ, but not beyond the tolerance. inputs: states of the first difference's
    objects in its step, in words; first_message: sequence number of the message with it.
    """

    begin: float = 0.0
    steps: int = 0
    messages: int = 0
    compared: int = 0
    differing: int = 0
    digest: int = 0
    recorded_duration: float = 0.0
    replay_duration: float = 0.0
    within: int = 0
    tolerance: float | None = None
    first_difference: Difference | None = None
    first_message: int | None = None
    inputs: list[str] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)
    foreign: bool = False
    hole: bool = False
    late: bool = False

    @property
    def verdict(self) -> Verdict:
        """The verdict. Equal bytes count whichever program recorded them; unequal ones only for the same program."""
        if self.first_difference is not None:
            return Verdict.NOT_COMPARABLE if self.foreign and self.tolerance is None else Verdict.DIVERGED
        return Verdict.NOT_COMPARABLE if self.hole or self.late or not self.compared else Verdict.IDENTICAL

    @property
    def speed(self) -> float:
        """Replay speed as a multiple of real time."""
        return self.recorded_duration / self.replay_duration if self.replay_duration > 0 else 0.0
