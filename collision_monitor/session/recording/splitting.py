"""When a recording continues in another file, and whether it keeps only the time around events."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

from collision_monitor.checks.numbers import checked_number
from collision_monitor.errors import SessionError


@dataclass(frozen=True)
class Splitting:
    """When a recording continues in another file, and whether it keeps only the time around events.

    size: bytes from which on another file follows; duration: the same in s; 0: never. on_event: keep only `before`
    seconds before each collision begins and `after` seconds after its begin. Raises SessionError for a number that is
    negative or infinite.
    """

    size: int = 0
    duration: float = 0.0
    on_event: bool = False
    before: float = 10.0
    after: float = 5.0

    def __post_init__(self) -> None:
        for name in ("size", "duration", "before", "after"):
            checked_number(getattr(self, name), f"recording, {name}", least=0.0, error=SessionError)

    @property
    def makes_files(self) -> bool:
        """Whether there may be more than one file."""
        return bool(self.size or self.duration or self.on_event)


ONE_FILE: Final = Splitting()
