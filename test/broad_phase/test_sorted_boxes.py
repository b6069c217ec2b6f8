"""Boxes that are sorted once and change later, against tests of all pairs."""

from __future__ import annotations

import numpy as np
import pytest

from collision_monitor.broad_phase.hashed_grid import make_hashed_grid, put_boxes, remove_boxes
from collision_monitor.broad_phase.region import Region
from collision_monitor.broad_phase.sorted_boxes import note_changed, overlapping_boxes, sorted_boxes


@pytest.mark.parametrize("spread", [8.0, 1e4], ids=["dense", "hashed"])
def test_boxes_that_change_are_found_where_they_are(spread: float) -> None:
    rng = np.random.default_rng(4)
    n, room = 300, 320
    centre = rng.uniform(-spread, spread, (room, 3))
    half = 10.0 ** rng.uniform(-2, 0.5, (room, 3)) * (1.0 if spread < 100 else 300.0)
    half[7] = half[:, 0].max() * 4
    half[9] = np.inf
    grid, every = make_hashed_grid(room), np.arange(n, dtype=np.int32)
    put_boxes(grid, every, centre, half)
    remove_boxes(grid, np.array([3, 5], np.int32))
    boxes = sorted_boxes(grid.box, n)
    found = np.empty(room + 1, np.int32)
    hits = 0
    for turn in range(6):
        for i in rng.integers(0, n, 60):
            region = Region(*centre[i], *half[i])
            count = overlapping_boxes(boxes, region, found)
            assert len(set(found[:count].tolist())) == count
            got = {j for j in found[:count].tolist() if grid.box[j]["level"] >= 0}
            there = np.flatnonzero(grid.box["level"] >= 0)
            meets = (np.abs(centre[there] - centre[i]) <= half[there] + half[i]).all(axis=1)
            assert got == set(there[meets].tolist())
            hits += len(got)
        which = rng.choice(n, 15, replace=False).astype(np.int32)
        centre[which] = rng.uniform(-spread, spread, (15, 3))
        put_boxes(grid, which, centre, half)
        note_changed(boxes, grid.box, which)
        if turn == 2:
            remove_boxes(grid, which[:4])
    assert boxes.count[0] > 50
    assert hits > 500
