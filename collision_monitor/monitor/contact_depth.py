"""Depth of two boxes that overlap, without witness points and features (`contact_details` off).

Two boxes that overlap need the separating axis test alone; what touches along the axis, the larger part of their test,
is left out. Distance, normal and bound are the same bytes as with details. Other pairs find their witness points while
they find their distance.
"""

from __future__ import annotations

from typing import Any

from collision_monitor._jit import device, inlined
from collision_monitor.geometry.shape_table import BOX
from collision_monitor.narrow_phase.box_box import axis_direction, sat
from collision_monitor.narrow_phase.contact_row import BOUND, DISTANCE, NORMAL, POINT_A
from collision_monitor.narrow_phase.core import half_extents
from collision_monitor.narrow_phase.pair_pose import PairPose, swapped
from collision_monitor.prediction.body_contact import RESULT, SHAPE_I, SHAPE_J, STATUS, TOUCHING, relative_now, widening
from collision_monitor.prediction.motion import rotation_now
from collision_monitor.tolerances import FACE_PREFERENCE, SAT_ROUND_OFF


@inlined
def _is_plain_box(multibody: Any, i: int) -> Any:
    """Whether body i is one box at its origin, without margin, which is the object itself."""
    table, parts, bodies = multibody
    s = bodies.first_shape[i]
    is_alone = parts.next[s] < 0 and not parts.placed[s]
    return is_alone and table.kind[s] == BOX and table.margin[s] == 0.0 and bodies.excess[i] == 0.0


@device
def depth_of_boxes(multibody: Any, i: int, j: int, now: float, query: Any, scratch: Any, result: Any) -> bool:
    """Write the contact of bodies i and j at `now` (s) into a result row, if they are plain boxes that overlap.

    The contact has no witness points, no closing speed (all 0) and no features (UNKNOWN). query, scratch, result: as of
    `body_contact`, which answers the pair where this returns False.
    """
    if not (_is_plain_box(multibody, i) and _is_plain_box(multibody, j)):
        return False
    table, _, bodies = multibody
    R = scratch.rotation
    rotation_now(bodies, i, now, scratch.quaternion, R[0])
    rotation_now(bodies, j, now, scratch.quaternion, R[1])
    relative = relative_now(bodies, i, j, now)
    pose = PairPose(R[0], R[1], relative.p)
    a, b = bodies.first_shape[i], bodies.first_shape[j]
    side = 1.0
    if a > b:  # the order in which dispatch.py tests them
        a, b = b, a
        pose = swapped(pose)
        side = -1.0
    gap, axis, sign = sat(half_extents(table, a), half_extents(table, b), pose, 0.0)
    if gap > 0.0:
        return False
    n = axis_direction(axis, sign, pose)
    ha, hb = table.size[a], table.size[b]
    size = ha[0] + ha[1] + ha[2] + hb[0] + hb[1] + hb[2]
    result[POINT_A:RESULT] = 0.0
    result[DISTANCE] = gap
    result[NORMAL], result[NORMAL + 1], result[NORMAL + 2] = side * n[0], side * n[1], side * n[2]
    result[BOUND] = SAT_ROUND_OFF * (abs(gap) + size) + FACE_PREFERENCE * size
    result[BOUND] += widening(relative, query.stale_acceleration)
    result[SHAPE_I], result[SHAPE_J] = bodies.first_shape[i], bodies.first_shape[j]
    result[STATUS] = TOUCHING
    return True
