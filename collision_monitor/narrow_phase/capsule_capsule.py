"""Capsules and spheres against each other, by the closest points of their core segments. (Ericson, 4.5.1)"""

from __future__ import annotations

from math import copysign, sqrt
from typing import Any

from collision_monitor._jit import inlined
from collision_monitor.geometry.vector import across, column, cross, direction, dot, scaled
from collision_monitor.narrow_phase.contact_row import FEATURE_TYPE_A, FEATURE_TYPE_B, write
from collision_monitor.narrow_phase.pair_pose import PairPose
from collision_monitor.narrow_phase.segment import segment_segment
from collision_monitor.shapes.feature_types import SURFACE
from collision_monitor.tolerances import GJK_TOUCHING, SAT_ROUND_OFF, SEGMENT_PARALLEL_SIN2


@inlined
def capsule_capsule_contact(ra: float, la: float, rb: float, lb: float, pose: PairPose, out: Any) -> None:
    """Write the contact; ra, rb: radii with margins, la, lb: half core lengths (m), 0 for a sphere.

    If the cores cross, the normal is perpendicular to both; if one lies on the other's line, it is perpendicular to it.
    """
    px, py, pz = pose.p
    u, v = scaled(column(pose.R_A, 2), la), scaled(column(pose.R_B, 2), lb)
    s, t = segment_segment(u, v, pose.p)
    w = (px + t * v[0] - s * u[0], py + t * v[1] - s * u[1], pz + t * v[2] - s * u[2])
    distance, n = direction(w)
    bound = SAT_ROUND_OFF * (distance + ra + rb + la + lb + abs(px) + abs(py) + abs(pz))
    if (abs(s) < 1.0 and abs(t) < 1.0) or distance <= GJK_TOUCHING * (la + lb):
        c = cross(u, v)
        length2 = dot(c, c)
        if la > 0.0 and lb > 0.0 and length2 > SEGMENT_PARALLEL_SIN2 * (la * la) * (lb * lb):
            # both closest points are inside their segments: the cross product is exact even if the difference is noise
            length = sqrt(length2)
            side = copysign(1.0, dot(c, w))
            n = (side * c[0] / length, side * c[1] / length, side * c[2] / length)
            distance = dot(n, w)
        elif distance <= GJK_TOUCHING * (la + lb):
            n = across(column(pose.R_A if la >= lb else pose.R_B, 2), w)
            distance = dot(n, w)
        if length2 <= SEGMENT_PARALLEL_SIN2 * (la * la) * (lb * lb) and length2 > 0.0:
            # treated as parallel, the segments were compared in the middle; at an end they may be nearer by this much
            bound += 2.0 * sqrt(length2) / max(la, lb)
    witness = (s * u[0] + ra * n[0], s * u[1] + ra * n[1], s * u[2] + ra * n[2])
    write(out, distance - (ra + rb), n, witness, bound)
    out[FEATURE_TYPE_A] = SURFACE
    out[FEATURE_TYPE_B] = SURFACE
