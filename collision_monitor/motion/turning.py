"""Angles by which bodies have turned away from their reference motions, several bodies at once."""

from __future__ import annotations

from math import inf, sqrt
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from collision_monitor._jit import device
from collision_monitor._jit.prefetch import prefetch
from collision_monitor.motion.course import STRAIGHT
from collision_monitor.motion.motion import chord_angle, turned_until
from collision_monitor.motion.trigonometry import LARGEST, sin_cos_within

BLOCK: Final = 128
"""Number of bodies whose data are copied into columns that fit the cache."""
COLUMNS: Final = 12

PREFETCH_AHEAD: Final = 16
"""How many bodies ahead the motions are prefetched, because the processor itself looks ahead within a page at most."""


def make_columns() -> NDArray[np.float64]:
    """Make scratch (COLUMNS + 1, BLOCK) for a block; the last row is for the angles."""
    return np.empty((COLUMNS + 1, BLOCK))


@device
def turned_away(bodies: Any, start: int, count: int, columns: Any, angles: Any) -> None:
    """Write upper bounds on the angles (rad) between bodies' last states and their references at that time into angles.

    For `count` <= BLOCK bodies from slot `start` on; columns (COLUMNS, BLOCK): scratch. inf: the reference has turned
    too far to compute it. The loop has no branch and no call, so the processor takes four or eight bodies at a time.
    """
    for k in range(count):
        i = start + k
        prefetch(bodies.motion, np.intp(min(i + PREFETCH_AHEAD, bodies.motion.size - 1)))
        m = bodies.motion[i]
        for c in range(4):
            columns[c, k] = bodies.ref_quaternion[i, c]
            columns[4 + c, k] = bodies.quaternion[i, c]
        columns[8, k], columns[9, k], columns[10, k] = m.wx, m.wy, m.wz
        columns[11, k] = bodies.time[i] - m.time
        if m.course != STRAIGHT:
            columns[11, k] = turned_until(m, bodies.time[i])
    for k in range(count):
        x, y, z, w = columns[0, k], columns[1, k], columns[2, k], columns[3, k]
        wx, wy, wz = columns[8, k], columns[9, k], columns[10, k]
        rate = sqrt(wx * wx + wy * wy + wz * wz)
        half = 0.5 * rate * columns[11, k]
        sine, cosine = sin_cos_within(half)
        sine = sine / rate if rate > 0.0 else 0.0
        ax, ay, az = sine * wx, sine * wy, sine * wz
        bx = cosine * x + ax * w + ay * z - az * y
        by = cosine * y - ax * z + ay * w + az * x
        bz = cosine * z + ax * y - ay * x + az * w
        bw = cosine * w - ax * x - ay * y - az * z
        angle = chord_angle(columns[4, k], columns[5, k], columns[6, k], columns[7, k], bx, by, bz, bw)
        angles[k] = angle if abs(half) < LARGEST else inf
