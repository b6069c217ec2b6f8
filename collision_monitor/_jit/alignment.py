"""Arrays whose rows begin at cache lines, and columns in one block of memory."""

from __future__ import annotations

from collections.abc import Mapping
from itertools import accumulate
from typing import Any

import numpy as np
from numpy.typing import DTypeLike, NDArray

from collision_monitor._jit.prefetch import CACHE_LINE


def aligned_zeros(rows: int, dtype: np.dtype[Any]) -> NDArray[Any]:
    """Allocate `rows` zeros of this type, the first at the begin of a cache line."""
    memory = np.zeros(rows * dtype.itemsize + CACHE_LINE, np.uint8)
    start = -memory.ctypes.data % CACHE_LINE
    return memory[start : start + rows * dtype.itemsize].view(dtype)


def columns_in_one_block(rows: int, types: Mapping[str, DTypeLike]) -> dict[str, NDArray[Any]]:
    """Allocate `rows` zeros of each of these types, by name, in one block, each column at the begin of a cache line.

    A row of 32 bytes then never lies in two lines, and the system can use large pages, so that random accesses miss
    fewer pages. NumPy requests these for blocks of 4 MiB and more.
    """
    dtypes = {name: np.dtype(given) for name, given in types.items()}
    sizes = [-(-rows * dtype.itemsize // CACHE_LINE) * CACHE_LINE for dtype in dtypes.values()]
    block = aligned_zeros(sum(sizes), np.dtype(np.uint8))
    starts = accumulate(sizes, initial=0)
    return {
        name: np.ndarray(rows, dtype, block.data, start)
        for (name, dtype), start in zip(dtypes.items(), starts, strict=False)
    }
