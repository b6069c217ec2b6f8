"""The guard around everything that reads a message: what is wrong is refused, and the rest of the message is taken."""

from __future__ import annotations

from types import TracebackType
from typing import Protocol

from collision_monitor.errors import CollisionMonitorError


class Refuses(Protocol):
    """What a guard reports to."""

    def refuse(self, name: str, text: str, count: int = 1) -> None:
        """Count what was left out, for a reason that is known."""

    def fail(self, name: str, what: str, error: Exception) -> None:
        """Count what was left out, for an error that nobody expected."""


class Guard:
    """A `with` block around one element of a message, or around the whole message of one source.

    Our own errors refuse the element. Every other exception is an error of this program or of a library below it, which
    also must not end the monitor (see `errors.reason_of`). KeyboardInterrupt and SystemExit go through.
    name: the key in the sources file. what: the element, in front of the reason.
    """

    __slots__ = ("_name", "_reports", "_what")

    def __init__(self, reports: Refuses, name: str, what: str = "") -> None:
        self._reports, self._name, self._what = reports, name, what

    def __enter__(self) -> None:
        return None

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> bool:
        if not isinstance(error, Exception):
            return False
        what = f"{self._what:.80}: " if self._what else ""
        if isinstance(error, CollisionMonitorError):
            self._reports.refuse(self._name, f"{what}{error}")
        else:
            self._reports.fail(self._name, what, error)
        return True
