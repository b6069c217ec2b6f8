"""Columns in one block: zeros, each at a cache line, apart from each other."""

from __future__ import annotations

import numpy as np

from collision_monitor._jit.alignment import aligned_zeros, columns_in_one_block
from collision_monitor._jit.prefetch import CACHE_LINE
from collision_monitor.motion.bodies import LAST_STATE, make_bodies


def test_columns_in_one_block_are_zeros_and_do_not_overlap() -> None:
    record = np.dtype([("a", np.float64, 3), ("b", np.int32)])
    types = {"flag": np.bool_, "number": np.float64, "row": (np.float64, 4), "record": record, "small": np.uint8}
    for rows in (1, 3, 64, 1000):
        columns = columns_in_one_block(rows, types)
        assert list(columns) == list(types)
        for name, column in columns.items():
            like = np.zeros(rows, types[name])
            assert column.dtype == like.dtype and column.shape == like.shape
            assert column.tobytes() == like.tobytes()
            assert column.ctypes.data % CACHE_LINE == 0
        for number, column in enumerate(columns.values()):
            column.view(np.uint8)[...] = number
        for number, column in enumerate(columns.values()):
            assert (column.view(np.uint8) == number).all()


def test_a_last_state_takes_two_cache_lines() -> None:
    bodies = make_bodies(3)
    assert LAST_STATE.itemsize == 2 * CACHE_LINE
    assert bodies.position.ctypes.data % CACHE_LINE == 0
    for name in LAST_STATE.names or ():
        assert getattr(bodies, name).strides == (LAST_STATE.itemsize, 8)
        getattr(bodies, name)[1] = 1.0
    assert bodies.position[[0, 2]].sum() == bodies.acceleration[[0, 2]].sum() == 0.0


def test_no_rows_and_one_row() -> None:
    assert aligned_zeros(0, np.dtype(np.float64)).shape == (0,)
    row = aligned_zeros(1, np.dtype([("a", np.float32), ("b", np.int32)]))
    assert row.tolist() == [(0.0, 0)] and row.ctypes.data % CACHE_LINE == 0
