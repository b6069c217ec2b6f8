"""Boxes sorted by cell once, and searched until many of them have changed.

To sort all boxes takes as long as hundreds of searches. So the boxes that have changed since are kept in a list, which
each search compares eight at a time, and their old places are skipped. When the list is long, all are sorted again.
"""

from __future__ import annotations

from math import sqrt
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from collision_monitor._jit import device, inlined
from collision_monitor._jit.vectors import LANES
from collision_monitor.broad_phase.box_pairs import boxes_at, sort_boxes
from collision_monitor.broad_phase.dense_grid import PAD, CellGrid, make_grid
from collision_monitor.broad_phase.hashed_grid import read_boxes
from collision_monitor.broad_phase.lanes import boxes_overlap, lowest_bit

MOST_CHANGED: Final = 8.0
"""Length of the list, in roots of the number of boxes. Longer: each search compares more. Shorter: more sorting."""


class SortedBoxes(NamedTuple):
    """N boxes by cell, and a list of up to M that have changed."""

    grid: CellGrid
    extent: Any  # (3, N + PAD) float64: half extents (m), sorted by cell; NaN: no box
    place: Any  # (N,) int32: place of a box in the list; -1: it has not changed
    changed: Any  # (M,) int32: the boxes in the list
    count: Any  # (1,) int64: their number
    centre: Any  # (3, M + PAD) float64: of the boxes in the list (m)
    half: Any  # (3, M + PAD) float64: their half extents (m)


def sorted_boxes(box: NDArray[np.void], count: int) -> SortedBoxes:
    """Sort the first `count` boxes (N,) GRID_BOX by cell."""
    most = int(MOST_CHANGED * sqrt(count)) + LANES
    sorted_ = SortedBoxes(
        make_grid(count),
        np.zeros((3, count + PAD)),
        np.full(len(box), -1, np.int32),
        np.zeros(most, np.int32),
        np.zeros(1, np.int64),
        np.zeros((3, most + PAD)),
        np.zeros((3, most + PAD)),
    )
    centre, half = np.empty((2, count, 3))
    read_boxes(box, centre, half)
    sort_boxes(centre, half, np.ones(count, np.bool_), sorted_.grid, sorted_.extent)
    return sorted_


@device
def note_changed(boxes: Any, box: Any, which: Any) -> None:
    """Put the boxes `which` (K,) of box (N,) GRID_BOX into the list, which must have room."""
    for i in which:
        k = boxes.place[i]
        if k < 0:
            k = boxes.place[i] = boxes.count[0]
            boxes.changed[k] = i
            boxes.count[0] = k + 1
        own = box[i]
        boxes.centre[0, k], boxes.centre[1, k], boxes.centre[2, k] = own.x, own.y, own.z
        boxes.half[0, k], boxes.half[1, k], boxes.half[2, k] = own.hx, own.hy, own.hz


@inlined
def overlapping_boxes(boxes: Any, region: Any, found: Any) -> Any:
    """Write the numbers of all boxes that overlap the Region into found (N + 1,); return how many there are.

    Boxes that were removed are among them.
    """
    n = 0
    for m in range(boxes_at(boxes.grid, boxes.extent, region, found)):
        i = boxes.grid.order[found[m]]
        if boxes.place[i] < 0:
            found[n] = i
            n += 1
    for k in range(0, boxes.count[0], LANES):
        bits = boxes_overlap(boxes.centre, boxes.half, k, region) & ((1 << min(boxes.count[0] - k, LANES)) - 1)
        while bits != 0:
            found[n] = boxes.changed[k + lowest_bit(bits)]
            n += 1
            bits &= bits - 1
    return n
