"""Which rays towards +z meet which faces, where float64 certainly decides it.

The filter is that of the determinants in `orientation`: a value above a part of the sum of its terms' sizes has the
right sign. Few rays pass so near to an edge, or begin so near to a face, that they need the exact determinants.
"""

from __future__ import annotations

from typing import Any, Final

from collision_monitor._jit import device, kernel
from collision_monitor.geometry.orientation import CANCELLATION, UNDERFLOW

MISSED: Final = 0
UNDECIDED: Final = 2
"""Elements of a table of crossings beside 1 and -1, the turn of a face that the ray meets."""


@device
def _turn(ax: float, ay: float, bx: float, by: float) -> int:
    """Sign of a x b, 0 where round-off or underflow may have changed it."""
    left, right = ax * by, ay * bx
    value, size = left - right, abs(left) + abs(right)
    if not (abs(value) > CANCELLATION * size and size > UNDERFLOW):
        return 0
    return 1 if value > 0.0 else -1


@device
def _crossing(p: Any, a: Any, b: Any, c: Any) -> int:
    """Element of the table of a point and a face."""
    x, y, z = p[0], p[1], p[2]
    if min(a[0], b[0], c[0]) > x or max(a[0], b[0], c[0]) < x:
        return MISSED
    if min(a[1], b[1], c[1]) > y or max(a[1], b[1], c[1]) < y or max(a[2], b[2], c[2]) < z:
        return MISSED
    first = _turn(b[0] - a[0], b[1] - a[1], x - a[0], y - a[1])
    second = _turn(c[0] - b[0], c[1] - b[1], x - b[0], y - b[1])
    third = _turn(a[0] - c[0], a[1] - c[1], x - c[0], y - c[1])
    if min(first, second, third) < 0 and max(first, second, third) > 0:
        return MISSED  # beside the projected face, whatever the signs of the others are
    if first == 0 or second == 0 or third == 0:
        return UNDECIDED
    ux, uy, uz = b[0] - a[0], b[1] - a[1], b[2] - a[2]
    vx, vy, vz = c[0] - a[0], c[1] - a[1], c[2] - a[2]
    wx, wy, wz = x - a[0], y - a[1], z - a[2]
    height = (ux * vy - uy * vx) * wz + (uy * vz - uz * vy) * wx + (uz * vx - ux * vz) * wy
    size = (abs(ux * vy) + abs(uy * vx)) * abs(wz)
    size += (abs(uy * vz) + abs(uz * vy)) * abs(wx) + (abs(uz * vx) + abs(ux * vz)) * abs(wy)
    largest = max(1.0, max(abs(wx), abs(wy), abs(wz)))
    if not (abs(height) > CANCELLATION * size and size > UNDERFLOW * largest):
        return UNDECIDED
    # the ray meets the face if its point is behind a face that looks up, or in front of one that looks down
    return first if (height > 0.0) != (first > 0) else MISSED


@kernel
def tabulate_crossings(points: Any, a: Any, b: Any, c: Any, table: Any) -> None:
    """Write to a table (n, m), int8, what is certain of rays from points (n, 3) and faces a, b, c (m, 3 each).

    1 or -1: the ray meets the face, which looks up or down, and begins below it. MISSED: it does not, and the point is
    not on the face. UNDECIDED: exact determinants decide.
    """
    for i in range(len(points)):
        for j in range(len(a)):
            table[i, j] = _crossing(points[i], a[j], b[j], c[j])
