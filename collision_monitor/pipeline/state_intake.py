"""The path of object states from message bytes into the monitor: each message is decoded once, and is one step."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Final, Self

from collision_monitor.codec import ObjectStateArray, decode_states
from collision_monitor.codec.states import COVARIANCE_SIZE
from collision_monitor.errors import MessageError, Refusal
from collision_monitor.monitor.intake import Observation
from collision_monitor.monitor.monitor import Monitor
from collision_monitor.monitor.result import StepResult

LARGEST_WRAP: Final = 1 << 16
"""A falling sequence number is the counter's wrap at 2^32 if at most this many messages are lost, else a restart."""

_LAST: Final = 0xFFFFFFFF
"""The sequence number before the wrap."""


@dataclass(frozen=True, eq=False, slots=True)
class ReceivedStates:
    """An ObjectStateArray as it arrived. message: its content; None if it cannot be decoded, and `error` says why."""

    data: bytes
    message: ObjectStateArray | None
    error: str = ""

    @classmethod
    def decode(cls, data: bytes) -> Self:
        """Decode the bytes of a message. Raises nothing: `StateIntake.take` refuses what cannot be decoded."""
        try:
            return cls(data, decode_states(data))
        except MessageError as error:
            return cls(data, None, str(error))


class StateIntake:
    """Takes steps of a monitor, and counts the messages of its publisher that were lost on the way.

    frame_id: of the messages. lost: number of lost messages so far. last: the last sequence number, None at first.
    """

    def __init__(self, monitor: Monitor, frame_id: str, lost: int = 0, last: int | None = None) -> None:
        self._monitor, self._frame_id = monitor, frame_id
        self.lost = lost
        self._last = last

    def take(self, states: ReceivedStates, now_ns: int | None) -> StepResult | None:
        """Take a step, within the monitor's clock. None: the message was refused. now_ns: see `Monitor.step`."""
        message = states.message
        if message is None:
            self._monitor.refuse(Refusal.MALFORMED, states.error)
            return None
        self._count_lost(message.sequence)
        if not is_in_frame(self._monitor, self._frame_id, message.frame_id, "ObjectStateArray"):
            return None
        count, rows = len(message.covariance), len(message.states)
        if count not in (0, COVARIANCE_SIZE * rows):
            self._monitor.refuse(
                Refusal.MALFORMED,
                f"ObjectStateArray.covariance: expected none or {COVARIANCE_SIZE} numbers for each of {rows} states, "
                f"got {count}",
            )
            return None
        covariance = message.covariance.reshape(-1, COVARIANCE_SIZE) if count else None
        given = Observation(message.stamp_ns, message.states, covariance=covariance, now_ns=now_ns)
        result = self._monitor.take_step(given)
        return result if result.accepted else None

    def _count_lost(self, sequence: int) -> None:
        """Process the sequence number of the next message. A publisher that does not count always sends 0."""
        if sequence == 0 and self._last != _LAST:
            return
        last, self._last = self._last, sequence
        if last is None or sequence == last:
            return
        gap = (sequence - last) % (_LAST + 1) - 1
        if sequence > last or gap <= LARGEST_WRAP:
            self.lost += gap

    def facts(self) -> dict[str, Any]:
        """Return the state, for a snapshot."""
        return {"messages_lost": self.lost, "sequence": self._last}

    @classmethod
    def restored(cls, monitor: Monitor, frame_id: str, facts: Mapping[str, Any]) -> Self:
        """Continue from `facts`. Raises KeyError for others."""
        return cls(monitor, frame_id, facts["messages_lost"], facts["sequence"])


def is_in_frame(monitor: Monitor, expected: str, frame_id: str, message: str) -> bool:
    """Return whether the frame of a message is the expected one, else refuse it. An empty frame counts as that one."""
    if frame_id in ("", expected):
        return True
    monitor.refuse(Refusal.FRAME, f"{message}: expected frame_id {expected!r}, got {frame_id!r}")
    return False
