"""What every file of a bag offers, whatever its format."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass
from typing import Final, NamedTuple, Protocol

LATEST: Final = (1 << 63) - 1
"""The largest time of receipt (ns since 1970): the year 2262."""


@dataclass
class StoredChannel:
    """The messages of one topic and type in a file.

    key: by which the file knows it. type: such as `nav_msgs/msg/Odometry`. encoding: of its messages, `cdr` or `ros1`.
    definition: of its type, in the form `form` (`ros2msg`, `ros2idl`, …). count: messages there. readable: those that
    can be read. stated: how many the file itself says elsewhere, in its `stated_by`; None if it does not. problem: why
    none can be used.
    """

    key: int
    topic: str
    type: str
    encoding: str
    definition: str = ""
    form: str = ""
    count: int = 0
    readable: int = 0
    stated: int | None = None
    stated_by: str = "summary"
    problem: str = ""


class StoredMessage(NamedTuple):
    """A message in a file. time: of receipt (ns)."""

    key: int
    time: int
    data: bytes


class Storage(Protocol):
    """A file of a bag."""

    @property
    def channels(self) -> Sequence[StoredChannel]:
        """All channels of the file."""

    def messages(self, keys: Collection[int]) -> Iterator[StoredMessage]:
        """Yield the readable messages of these channels in order of time. Raises SessionError."""

    def close(self) -> None:
        """Close the file."""


def damaged_bag(path: object, reason: str) -> str:
    """Return the text of an error about a file that cannot be read."""
    return f"{path}: expected a bag, cannot be read: {reason}"
