"""Arrays whose rows begin at cache lines, and structures of arrays in one block of memory."""

from __future__ import annotations

from typing import Any, NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray

from collision_monitor._jit.prefetch import CACHE_LINE

Columns = TypeVar("Columns", bound=NamedTuple)


def aligned_zeros(rows: int, dtype: np.dtype[Any]) -> NDArray[Any]:
    """Allocate `rows` zeros of this type, the first at the begin of a cache line."""
    memory = np.zeros(rows * dtype.itemsize + CACHE_LINE, np.uint8)
    start = -memory.ctypes.data % CACHE_LINE
    return memory[start : start + rows * dtype.itemsize].view(dtype)


def in_one_block(columns: Columns) -> Columns:
    """Copy the arrays of a structure into one block, each to the begin of a cache line.

    A row of 32 bytes then never lies in two lines, and the system can use large pages, so that random accesses miss
    fewer pages. NumPy requests these for blocks of 4 MiB and more.
    """
    sizes = [-(-column.nbytes // CACHE_LINE) * CACHE_LINE for column in columns]
    block = aligned_zeros(sum(sizes), np.dtype(np.uint8))
    copies = []
    for column, end in zip(columns, np.cumsum(sizes).tolist(), strict=True):
        start = end - (-(-column.nbytes // CACHE_LINE) * CACHE_LINE)
        copy = block[start : start + column.nbytes].view(column.dtype).reshape(column.shape)
        copy[...] = column
        copies.append(copy)
    return type(columns)(*copies)
