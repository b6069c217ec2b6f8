"""The contact and the first impact of two convex solids, each in one call of a kernel."""

from __future__ import annotations

import threading
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from collision_monitor.narrow_phase.contact_row import CONTACT_SIZE
from collision_monitor.query.contact.contact_rows import contact_row
from collision_monitor.query.impact.pair_impact_rows import TOO_SMALL, TOUCHING, impact_memory, pair_impact_rows
from collision_monitor.query.packed import packed_motion, packed_pose, packed_shape, pair_memory

Array = NDArray[np.float64]


class PairMemory(threading.local):
    """Work memory of each thread, as large as its largest pair of hulls so far."""

    def __init__(self) -> None:
        self._vertices = 128
        self.memory = pair_memory(self._vertices)
        self.impact = impact_memory()

    def enlarge(self, a: Array, b: Array) -> Array:
        """Return memory for every pair of the packed shapes in a and in b; a shape has fewer vertices than numbers."""
        if len(a) + len(b) > self._vertices:
            self._vertices = len(a) + len(b)
            self.memory = pair_memory(self._vertices)
        return self.memory


MEMORY: Final = PairMemory()

_START: Final = np.zeros(1, np.int64)
"""The place of a packed shape that stands alone."""


def packed_contact(shape_a: Any, pose_a: Any, shape_b: Any, pose_b: Any) -> tuple[float, float, Array] | None:
    """Signed distance and error bound (m) of two solids of PACKED_KINDS, and their contact row, points in the world.

    None for other arguments, also for those that are no shapes or no poses.
    """
    try:
        a, x_a, b, x_b = shape_a.packed_shape, pose_a.packed_pose, shape_b.packed_shape, pose_b.packed_pose
    except AttributeError:
        a, b = packed_shape(shape_a), packed_shape(shape_b)
        x_a, x_b = packed_pose(pose_a), packed_pose(pose_b)
        if a is None or b is None or x_a is None or x_b is None:
            return None
    row = np.empty(CONTACT_SIZE)
    distance, bound = contact_row.entry(a, x_a, b, x_b, MEMORY.memory, row)
    if bound < 0.0:
        distance, bound = contact_row.entry(a, x_a, b, x_b, MEMORY.enlarge(a, b), row)
    return distance, bound, row


def convex_impact(
    shape_a: Any, motion_a: Any, shape_b: Any, motion_b: Any, query: tuple[float, float, float, int]
) -> tuple[float, float] | None:
    """First impact of two moving solids of PACKED_KINDS: lower and upper (s), infinite for none.

    query: horizon (s), tolerance (m), separation (m), iterations. None for other arguments, and for solids that touch
    at the start, which have to be followed (touching.py).
    """
    try:
        a, s_a, b, s_b = shape_a.packed_shape, motion_a.packed_motion, shape_b.packed_shape, motion_b.packed_motion
    except AttributeError:
        a, b = packed_shape(shape_a), packed_shape(shape_b)
        s_a, s_b = packed_motion(motion_a), packed_motion(motion_b)
        if a is None or b is None or s_a is None or s_b is None:
            return None
    times, wanted = np.empty((1, 3)), np.array(query)
    pair_impact_rows(a, _START, s_a, b, _START, s_b, wanted, MEMORY.impact, MEMORY.memory, times)
    if times[0, 2] == TOO_SMALL:
        pair_impact_rows(a, _START, s_a, b, _START, s_b, wanted, MEMORY.impact, MEMORY.enlarge(a, b), times)
    lower, upper, code = times[0].tolist()
    return None if code == TOUCHING else (lower, upper)
