"""Arrays in one block: the same content, each at a cache line, apart from each other."""

from __future__ import annotations

import numpy as np

from collision_monitor._jit.alignment import aligned_zeros, in_one_block
from collision_monitor._jit.prefetch import CACHE_LINE
from collision_monitor.prediction.bodies import make_bodies


def test_columns_in_one_block_are_the_same_and_do_not_overlap() -> None:
    for capacity in (1, 3, 64, 1000):
        given = make_bodies(capacity)
        copies = in_one_block(given)
        assert type(copies) is type(given)
        for number, (copy, column) in enumerate(zip(copies, given, strict=True)):
            assert copy.dtype == column.dtype and copy.shape == column.shape
            assert copy.tobytes() == column.tobytes()
            assert copy.ctypes.data % CACHE_LINE == 0
            copy.view(np.uint8)[...] = number
        for number, copy in enumerate(copies):
            assert (copy.view(np.uint8) == number).all()


def test_no_rows_and_one_row() -> None:
    assert aligned_zeros(0, np.dtype(np.float64)).shape == (0,)
    row = aligned_zeros(1, np.dtype([("a", np.float32), ("b", np.int32)]))
    assert row.tolist() == [(0.0, 0)] and row.ctypes.data % CACHE_LINE == 0
