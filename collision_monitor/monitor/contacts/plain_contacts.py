"""Contacts of the two commonest pairs: boxes that overlap, and balls. Each body is one shape at its origin.

They are the same bytes as those of `body_contact`, without its loop over shapes, its choice of a test and its copies,
which take longer than the tests of these pairs. Without details (`contact_details` off), what touches along the axis,
the larger part of the test of boxes, is left out as well.
"""

from __future__ import annotations

from typing import Any

from collision_monitor._jit import inlined
from collision_monitor.geometry.vector import opposite
from collision_monitor.impact.body_contact import (
    SHAPE_I,
    SHAPE_J,
    STATUS,
    TOUCHING,
    closing_now,
    move_to_world,
    relative_now,
    widening,
)
from collision_monitor.impact.body_impact import CLOSING
from collision_monitor.motion.last_state import rotation_now
from collision_monitor.narrow_phase.box_box import axis_direction, sat, touching_features
from collision_monitor.narrow_phase.contact_row import BOUND, DISTANCE, NORMAL, POINT_A
from collision_monitor.narrow_phase.core import half_extents
from collision_monitor.narrow_phase.dispatch import is_second, mirror
from collision_monitor.narrow_phase.pair_pose import PairPose, swapped
from collision_monitor.narrow_phase.sphere_sphere import sphere_sphere_contact
from collision_monitor.shapes.kinds.sphere import SPHERE
from collision_monitor.tolerances import FACE_PREFERENCE, SAT_ROUND_OFF


@inlined
def plain_contact(
    multibody: Any, i: int, j: int, now: float, query: Any, has_details: bool, scratch: Any, result: Any
) -> Any:
    """Write the contact of bodies i and j at `now` (s) into a result row, if both are balls, or boxes that overlap.

    Both are plain (`note_plain`). Without details, the contact of boxes has no witness points, no closing speed (all 0)
    and no features (UNKNOWN). query, scratch, result: as of `body_contact`, which answers the pair where this returns
    False.
    """
    table, _, bodies = multibody
    kind = bodies.plain[i]
    if kind == 0 or kind != bodies.plain[j]:
        return False
    a, b = bodies.first_shape[i], bodies.first_shape[j]
    result[SHAPE_I], result[SHAPE_J], result[STATUS] = a, b, TOUCHING
    relative = relative_now(bodies, i, j, now)
    is_swapped = is_second(table, a, b, relative.p)
    if is_swapped:
        a, b = b, a
    if kind == SPHERE:
        p = opposite(relative.p) if is_swapped else relative.p
        sphere_sphere_contact(table.size[a, 0] + table.margin[a], table.size[b, 0] + table.margin[b], p, result)
        if not result[DISTANCE] <= query.margin:
            return False
    else:
        R = scratch.rotation
        rotation_now(bodies, i, now, scratch.quaternion, R[0])
        rotation_now(bodies, j, now, scratch.quaternion, R[1])
        pose = PairPose(R[0], R[1], relative.p)
        if is_swapped:
            pose = swapped(pose)
        gap, axis, sign = sat(half_extents(table, a), half_extents(table, b), pose, 0.0)
        if gap > 0.0:
            return False
        n = axis_direction(axis, sign, pose)
        if not has_details:
            ha, hb = table.size[a], table.size[b]
            size = ha[0] + ha[1] + ha[2] + hb[0] + hb[1] + hb[2]
            side = -1.0 if is_swapped else 1.0
            result[POINT_A:SHAPE_I] = 0.0
            result[DISTANCE] = gap
            result[NORMAL], result[NORMAL + 1], result[NORMAL + 2] = side * n[0], side * n[1], side * n[2]
            result[BOUND] = SAT_ROUND_OFF * (abs(gap) + size) + FACE_PREFERENCE * size
            result[BOUND] += widening(relative, query.stale_acceleration)
            return True
        touching_features(table.size[a], table.size[b], pose, gap, n, result, scratch.work)
    if is_swapped:
        mirror(result, relative.p)
    result[CLOSING] = closing_now(relative, result)
    result[BOUND] += widening(relative, query.stale_acceleration)
    move_to_world(bodies, i, relative, result)
    return True
