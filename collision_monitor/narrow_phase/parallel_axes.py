"""Depth of two overlapping solids of revolution with parallel axes, computed from two polygons in (radius, height).

Their difference is again a solid of revolution, and its profile is the difference of their profiles. The depth is
therefore the least over the few edge normals of the two profiles. EPA would approximate whole circles of tied
directions point by point.
"""

from __future__ import annotations

from math import copysign, inf, sqrt
from typing import Any, Final

from collision_monitor._jit import device, inlined
from collision_monitor.geometry.vector import Vector
from collision_monitor.narrow_phase.core import Core
from collision_monitor.narrow_phase.work_memory import P_AB, R_AB
from collision_monitor.shapes.calls import revolved_profile
from collision_monitor.shapes.registry import REVOLVED
from collision_monitor.tolerances import FEATURE_TIE, SEGMENT_PARALLEL_SIN2

ROUND_OFF_SLANT: Final = sqrt(SEGMENT_PARALLEL_SIN2)
"""Slant of axes up to which they are taken as parallel, and EPA is not tried."""


@inlined
def axes_slant(A: Core, B: Core, work: Any) -> float:
    """How far, per metre of size, two solids of revolution move if their axes are made parallel; infinite for others.

    B's axis is the last column of R_AB in work. Points at a radius r move by 2 r sin(angle / 2), less than the result.
    """
    if not (REVOLVED[B.kind] and REVOLVED[A.kind]):
        return inf
    x, y = work[R_AB + 2], work[R_AB + 5]
    return sqrt(2.0) * sqrt(x * x + y * y)  # at most 90 degrees: their axes have no sign here


@device
def _reach(top: float, bottom: float, half: float, r: float, z: float) -> float:
    """Support value of a profile along (r, z)."""
    return max(abs(r) * top + z * half, abs(r) * bottom - z * half)


@device
def _touching(top: float, bottom: float, half: float, r: float, z: float, tie: float) -> Any:
    """Interval along (-z, r) in which the profile is within `tie` (m) of its supporting line across (r, z)."""
    reach = _reach(top, bottom, half, r, z) - tie
    least, most = inf, -inf
    for k in range(4):
        y = half if k < 2 else -half
        x = top if k < 2 else bottom
        if k % 2:
            x = -x
        if r * x + z * y >= reach:
            along = r * y - z * x
            least = min(least, along)
            most = max(most, along)
    return least, most


@device
def parallel_axes_depth(A: Core, B: Core, work: Any, size: float) -> tuple[float, Vector, Vector]:
    """Depth (m) of two overlapping cores with parallel axes, the unit normal, and the witness point on A (m).

    The results are in A's frame, and so is the pose of B in work. The witness point of touching faces is the middle of
    their common part.
    """
    top_a, bottom_a, half_a = revolved_profile(A.kind, A.size)
    top_b, bottom_b, half_b = revolved_profile(B.kind, B.size)
    x, y, height = work[P_AB], work[P_AB + 1], work[P_AB + 2]
    reach = sqrt(x * x + y * y)
    if reach > 0.0:
        x, y = x / reach, y / reach
    else:
        x, y = 1.0, 0.0
    if work[R_AB + 8] < 0.0:
        top_b, bottom_b = bottom_b, top_b
    depth = inf
    r = z = 0.0
    for k in range(5):
        # normals of the caps, the nearer one first; of the sides; of A's slope; of B's slope, reversed
        cr, cz = 0.0, copysign(1.0, height)
        if k == 1:
            cz = -cz
        elif k == 2:
            cr, cz = 1.0, 0.0
        elif k == 3:
            cr, cz = 2.0 * half_a, bottom_a - top_a
        elif k == 4:
            cr, cz = 2.0 * half_b, top_b - bottom_b
        length = sqrt(cr * cr + cz * cz)
        if length > 0.0:
            cr, cz = cr / length, cz / length
            d = (
                _reach(top_a, bottom_a, half_a, cr, cz)
                + _reach(top_b, bottom_b, half_b, -cr, -cz)
                - (cr * reach + cz * height)
            )
            if d < depth:
                depth, r, z = d, cr, cz
    tie = FEATURE_TIE * size
    least_a, most_a = _touching(top_a, bottom_a, half_a, r, z, tie)
    least_b, most_b = _touching(top_b, bottom_b, half_b, -r, -z, tie)
    at = r * height - z * reach
    along = 0.5 * (max(least_a, at - most_b) + min(most_a, at - least_b))
    along = min(max(along, least_a), most_a)
    out = _reach(top_a, bottom_a, half_a, r, z)
    ar, az = out * r - along * z, out * z + along * r
    return depth, (r * x, r * y, z), (ar * x, ar * y, az)
