"""Sphere, capsule or cylinder against a parallel cylinder, computed from boxes in (radius, height).

The difference of two parallel cylinders is again a cylinder. EPA is at its worst in this case, because all directions
around the common axis tie. Cylinders that are not parallel go to convex_convex.
"""

from __future__ import annotations

from math import copysign, sqrt
from typing import Any

from collision_monitor._jit import inlined
from collision_monitor.geometry.vector import Vector, across, along, column, cross, dot, scaled
from collision_monitor.narrow_phase.contact_row import FEATURE_TYPE_A, write
from collision_monitor.narrow_phase.core import rounding
from collision_monitor.narrow_phase.pair_pose import PairPose
from collision_monitor.shapes.feature_types import SURFACE
from collision_monitor.shapes.kinds.cylinder import CYLINDER
from collision_monitor.shapes.kinds.sphere import SPHERE
from collision_monitor.tolerances import SAT_ROUND_OFF, SEGMENT_PARALLEL_SIN2


@inlined
def is_parallel(table: Any, a: int, pose: PairPose) -> bool:
    """Whether shape a, a sphere, capsule or cylinder, is parallel to the z axis of B's frame (a sphere always is)."""
    if table.kind[a] == SPHERE:
        return True
    c = cross(column(pose.R_A, 2), column(pose.R_B, 2))
    return dot(c, c) <= SEGMENT_PARALLEL_SIN2


@inlined
def parallel_cylinders_contact(table: Any, a: int, b: int, R: Any, p: Vector, out: Any) -> None:
    """Write the contact of shape a and cylinder b, with rotation R (3, 3), for which `is_parallel` holds.

    The witness points of touching faces are in the middle of their common part.
    """
    kind = table.kind[a]
    round_a = rounding(table, a)
    round_b = table.margin[b]
    ra = table.size[a, 0] if kind == CYLINDER else 0.0
    ha = 0.0 if kind == SPHERE else table.size[a, 1]
    rb, hb = table.size[b, 0], table.size[b, 1]
    px, py, pz = p
    axis = column(R, 2)
    height = dot(axis, p)
    x, y, z = px - height * axis[0], py - height * axis[1], pz - height * axis[2]
    reach = sqrt(x * x + y * y + z * z)
    size = ra + ha + rb + hb
    if reach > SAT_ROUND_OFF * (size + abs(height)):
        radial = (x / reach, y / reach, z / reach)
    else:
        radial = across(axis, (x, y, z))
    up = copysign(1.0, height)
    out_of_side = reach - (ra + rb)
    out_of_cap = abs(height) - (ha + hb)
    if out_of_side > 0.0 and out_of_cap > 0.0:
        distance = sqrt(out_of_side * out_of_side + out_of_cap * out_of_cap)
        side, cap = out_of_side / distance, up * out_of_cap / distance
        r, h = ra, up * ha
    elif out_of_side >= out_of_cap:
        distance, side, cap = out_of_side, 1.0, 0.0
        r, h = ra, 0.5 * (max(-ha, height - hb) + min(ha, height + hb))
    else:
        distance, side, cap = out_of_cap, 0.0, up
        r, h = 0.5 * (max(-ra, reach - rb) + min(ra, reach + rb)), up * ha
    n = along(scaled(radial, side), cap, axis)
    bound = (SAT_ROUND_OFF + sqrt(SEGMENT_PARALLEL_SIN2)) * (size + abs(px) + abs(py) + abs(pz) + round_a + round_b)
    witness = along(along(scaled(radial, r), h, axis), round_a, n)
    write(out, distance - round_a - round_b, n, witness, bound)
    if kind != CYLINDER:
        out[FEATURE_TYPE_A] = SURFACE
