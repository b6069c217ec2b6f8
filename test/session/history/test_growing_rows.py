"""Rows that arrive message by message."""

from __future__ import annotations

import numpy as np
import pytest

from collision_monitor.errors import SessionError
from collision_monitor.records import CONTACT
from collision_monitor.session.history import growing_rows
from collision_monitor.session.history.growing_rows import GrowingRows, available_memory


def test_rows_come_back_in_order_with_their_keys():
    rows, rng = GrowingRows(CONTACT), np.random.default_rng(1)
    counts = rng.integers(0, 40_000, 12)
    for key, count in enumerate(counts):
        some = np.zeros(count, CONTACT)
        some["id_a"] = np.arange(count)
        rows.append(key, some)
    joined, keys = rows.joined()
    np.testing.assert_array_equal(keys, np.repeat(np.arange(12), counts))
    np.testing.assert_array_equal(joined["id_a"], np.concatenate([np.arange(count) for count in counts]))


def test_rows_that_would_take_the_last_memory_are_refused(monkeypatch):
    assert 1 << 20 < available_memory() < 1 << 50
    monkeypatch.setattr(growing_rows, "LEAST_LEFT", available_memory() + (1 << 30))
    with pytest.raises(SessionError, match="MiB of available memory"):
        GrowingRows(CONTACT).append(0, np.zeros(1, CONTACT))
