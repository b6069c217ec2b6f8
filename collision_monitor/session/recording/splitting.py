"""When a recording continues in another file, and whether it keeps only the time around events."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

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
            value = getattr(self, name)
            if not 0 <= value < float("inf"):
                raise SessionError(f"recording, {name}: expected a finite number, at least 0, got {value!r}")

    @property
    def makes_files(self) -> bool:
        """Whether there may be more than one file."""
        return bool(self.size or self.duration or self.on_event)


ONE_FILE: Final = Splitting()
