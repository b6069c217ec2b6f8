"""Known axes: directions that separated two bodies in one sample of their motion, tried first in the next samples.

For bodies that do not turn, the gap along a fixed direction n is linear in time: n.p - h + n.v t, where h is the reach
of both shapes along n. It costs a few products. If the gap stays open, no distance is computed; if it closes, the
search begins at that time.
"""

from __future__ import annotations

from math import inf, sqrt
from typing import Any, Final

from collision_monitor._jit import device, inlined
from collision_monitor.motion.bodies import place_shape
from collision_monitor.narrow_phase.core import rounding
from collision_monitor.shapes.calls import core_support

AXES: Final = 8
"""Half of them are from samples that passed, half from samples that met. Each more costs 2 ns per sample."""


@device
def remember(table: Any, parts: Any, pair: Any, passed: bool, n: int, scratch: Any, axes: Any) -> None:
    """Store the direction in scratch.out as one of the axes (AXES, 4) of a pair of shapes (ShapePair).

    n: index of the sample, which selects the axis to replace; passed: whether the sample passed. Behind one whose
    bounding spheres did not meet, scratch.out has any vector, which is an axis too once its length is 1.
    """
    A, B, a, b = pair
    R_a, R_b, out = scratch.rotation[2], scratch.rotation[3], scratch.out
    oa = place_shape(table, parts, a, A.rotation, R_a)
    ob = place_shape(table, parts, b, B.rotation, R_b)
    length = sqrt(out[0] * out[0] + out[1] * out[1] + out[2] * out[2])
    if not 0.0 < length < inf:
        return
    x, y, z = out[0] / length, out[1] / length, out[2] / length
    reach = rounding(table, a) + rounding(table, b) + x * (oa[0] - ob[0]) + y * (oa[1] - ob[1]) + z * (oa[2] - ob[2])
    reach += core_support(
        table, a,
        x * R_a[0, 0] + y * R_a[1, 0] + z * R_a[2, 0],
        x * R_a[0, 1] + y * R_a[1, 1] + z * R_a[2, 1],
        x * R_a[0, 2] + y * R_a[1, 2] + z * R_a[2, 2],
    )  # fmt: skip
    reach += core_support(
        table, b,
        -x * R_b[0, 0] - y * R_b[1, 0] - z * R_b[2, 0],
        -x * R_b[0, 1] - y * R_b[1, 1] - z * R_b[2, 1],
        -x * R_b[0, 2] - y * R_b[1, 2] - z * R_b[2, 2],
    )  # fmt: skip
    axis = axes[n % (AXES // 2) + (0 if passed else AXES // 2)]
    axis[0], axis[1], axis[2], axis[3] = x, y, z, reach


@inlined
def parted_until(axes: Any, A: Any, B: Any, end: float, wanted: float) -> float:
    """Return a time (s) until which the gap is larger than `wanted` (m); infinite: until `end`."""
    px, py, pz = B.x - A.x, B.y - A.y, B.z - A.z
    vx, vy, vz = B.vx - A.vx, B.vy - A.vy, B.vz - A.vz
    latest = 0.0
    for k in range(AXES):
        x, y, z = axes[k, 0], axes[k, 1], axes[k, 2]
        gap = x * px + y * py + z * pz - axes[k, 3] - wanted
        rate = x * vx + y * vy + z * vz
        if gap > 0.0:
            if gap + rate * end > 0.0:
                return inf
            latest = max(latest, -gap / rate)
    return latest
