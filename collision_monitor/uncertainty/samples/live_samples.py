"""The live samples of a segment: those that may still meet in it. The others make room, and planes meet fewer samples.

PlaneMemory.live has the numbers of the live samples, in ascending order. Their rows, entry, leave and checked are in
the same order.
"""

from __future__ import annotations

from typing import Any, Final

from collision_monitor._jit import device, inlined
from collision_monitor.uncertainty.samples.sample_gaps import NOT_TURNED

FEWEST: Final = 16
"""Number of samples from which on none is dropped, because that would take longer."""


@inlined
def place_of(sample: int, live: Any, count: int) -> int:
    """Place of a sample among the first `count` live ones (S,); -1: it is not one of them."""
    low, high = 0, count
    while low < high:
        middle = (low + high) // 2
        if live[middle] < sample:
            low = middle + 1
        else:
            high = middle
    return low if low < count and live[low] == sample else -1


@device
def drop_missed(count: int, at: int, turning: Any, memory: Any) -> tuple[int, int]:
    """Drop the live samples that miss, if at most half of the first `count` ones may still meet.

    turning: see `set_samples`. Returns the number of those that are left, and the new place of the sample at place
    `at`, or of the next one that is left.
    """
    rows, entry, leave, live, checked = memory.rows.node, memory.entry, memory.leave, memory.live, memory.checked
    left = 0
    for n in range(count):
        left += 1 if entry[n] <= leave[n] else 0
    if 2 * left > count or count <= FEWEST:
        return count, at
    kept = memory.kept
    left, moved = 0, 0
    for n in range(count):  # without a branch, because no processor predicts which samples meet
        kept[left] = n
        meets = 1 if entry[n] <= leave[n] else 0
        left += meets
        moved += meets if n < at else 0
    for place in range(3):
        for part in range(3):
            if part > 0 and turning[part - 1] == NOT_TURNED:
                continue
            for r in range(3 * part, 3 * part + 3):
                row = rows[place, r]
                for n in range(left):
                    row[n] = row[kept[n]]
    for n in range(left):
        m = kept[n]
        entry[n], leave[n], live[n], checked[n] = entry[m], leave[m], live[m], checked[m]
    return left, moved
