"""The event list: a tournament tree over the spheres, whose root is the earliest event.

Each sphere has one event. A new time replays the matches on the way to the root, and stops at the first match with
the old result, which is after two levels on average. Ties go to the lower index. Source: tournament trees, D. E. Knuth,
The Art of Computer Programming 3, section 5.4.1; one event per sphere: F. Smallenburg, Eur. Phys. J. E 45, 22 (2022).
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from collision_monitor._jit import device


def empty_tree(count: int) -> tuple[NDArray[np.float64], NDArray[np.int32]]:
    """Return `times` and `winners` of a tree for `count` spheres without events (time infinite)."""
    leaves = 1 << max(count - 1, 1).bit_length()
    winners = np.zeros(2 * leaves, np.int32)
    winners[leaves:] = np.arange(leaves)
    level = leaves
    while level > 1:
        winners[level // 2 : level] = winners[level : 2 * level : 2]
        level //= 2
    return np.full(2 * leaves, np.inf), winners


@device
def schedule(times: Any, winners: Any, sphere: int, time: float) -> None:
    """Give the sphere's event this time."""
    node = len(times) // 2 + sphere
    times[node] = time
    while node > 1:
        left = node & ~1
        first, winner = times[left], winners[left]
        if times[left + 1] < first:
            first, winner = times[left + 1], winners[left + 1]
        node >>= 1
        if times[node] == first and winners[node] == winner:
            return
        times[node], winners[node] = first, winner
