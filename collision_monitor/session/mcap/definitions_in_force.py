"""Limits of the schemas and channels of a file, which a reader keeps while it reads the messages."""

from __future__ import annotations

from typing import Final

LARGEST_DEFINITION: Final = 1 << 20
"""Bytes of a schema or channel. The longest definition of ROS 2, with all of its nested types, has 30 kB."""

_ALL: Final = 16 << 20
"""Bytes of all that are in force: those of 3,000 message types."""


class DefinitionsInForce:
    """The size of each schema and channel in force. A later one replaces that of the same kind and id."""

    def __init__(self) -> None:
        self._sizes: dict[tuple[int, int], int] = {}
        self._all = 0

    def add(self, opcode: int, number: int, size: int) -> None:
        """Add a schema or channel of `size` bytes. Raises ValueError if it is too long, or all of them are."""
        key = opcode, number
        total = self._all + size - self._sizes.get(key, 0)
        if size > LARGEST_DEFINITION or total > _ALL:
            raise ValueError(
                f"expected schemas and channels of at most {LARGEST_DEFINITION} bytes, and {_ALL} for all, got more"
            )
        self._sizes[key], self._all = size, total
