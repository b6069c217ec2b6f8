"""An array whose rows arrive message by message."""

from __future__ import annotations

from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray

from collision_monitor.errors import SessionError
from collision_monitor.session.history.history import Records

_BLOCK: Final = 1 << 16
"""Rows that are allocated at a time."""

LEAST_LEFT: Final = 512 << 20
"""Bytes of memory that stay available to other programs. A kilobyte of a hostile session can hold megabytes of rows."""

_MEMORY: Final = Path("/proc/meminfo")


class GrowingRows:
    """Rows that grow message by message, each with the key of its message. The messages are not kept."""

    def __init__(self, dtype: np.dtype[np.void]) -> None:
        self.keys: list[int] = []
        self._dtype = dtype
        self._counts: list[int] = []
        self._blocks: list[Records] = []
        self._room = 0

    def append(self, key: int, rows: Records) -> None:
        """Append a copy of the rows. Raises SessionError if the machine has no memory for them."""
        self.keys.append(key)
        self._counts.append(len(rows))
        if len(rows) > self._room:
            self._close()
            self._room = max(_BLOCK, len(rows))
            _check_memory(self._room * self._dtype.itemsize)
            self._blocks.append(np.empty(self._room, self._dtype))
        block = self._blocks[-1] if self._blocks else np.empty(0, self._dtype)
        begin = len(block) - self._room
        block[begin : begin + len(rows)] = rows
        self._room -= len(rows)

    def joined(self) -> tuple[Records, NDArray[np.int64]]:
        """Return all rows and their keys. Blocks are freed once copied, so that memory never holds all rows twice."""
        self._close()
        keys = np.repeat(np.array(self.keys, np.int64), self._counts)
        joined = np.empty(len(keys), self._dtype)
        end = len(joined)
        while self._blocks:
            block = self._blocks.pop()
            joined[end - len(block) : end] = block
            end -= len(block)
        return joined, keys

    def _close(self) -> None:
        if self._blocks and self._room:
            self._blocks[-1] = self._blocks[-1][: -self._room]
        self._room = 0


def _check_memory(needed: int) -> None:
    """Raise SessionError if less than LEAST_LEFT would stay available."""
    available = available_memory()
    if available - needed < LEAST_LEFT:
        raise SessionError(
            f"expected {(needed + LEAST_LEFT) >> 20} MiB of available memory to hold more of the session, got "
            f"{available >> 20} MiB: read a shorter session, for example one of a recording that is split by time"
        )


def available_memory() -> int:
    """Return the memory (bytes) that the kernel estimates to be available without swapping."""
    with _MEMORY.open() as lines:
        return next(int(line.split()[1]) << 10 for line in lines if line.startswith("MemAvailable:"))
