"""Half-space against any convex shape, by the distance of its deepest point from the plane; and two half-spaces."""

from __future__ import annotations

from math import inf, sqrt
from typing import Any

from collision_monitor._jit import device, inlined
from collision_monitor.geometry.vector import (
    Vector,
    along,
    cross,
    dot,
    minus,
    opposite,
    rotate,
    rotate_back,
    scaled,
    sum_of_sizes,
)
from collision_monitor.narrow_phase.contact_row import DISTANCE, FEATURE_TYPE_A, FEATURE_TYPE_B, write
from collision_monitor.narrow_phase.core import core_of, rounding
from collision_monitor.narrow_phase.pair_pose import PairPose
from collision_monitor.shapes.calls import support_point
from collision_monitor.shapes.feature_types import FACE
from collision_monitor.tolerances import OPPOSED, SAT_ROUND_OFF


@inlined
def _normal(table: Any, slot: int, R: Any) -> Vector:
    """Outward normal of a half-space in world axes."""
    return rotate(R, (table.size[slot, 0], table.size[slot, 1], table.size[slot, 2]))


@device
def half_space_contact(table: Any, a: int, b: int, pose: PairPose, out: Any) -> None:
    """Write the contact of convex shape a and half-space b.

    The only way out of a half-space is along its normal, at any depth.
    """
    offset = table.size[b, 3]
    n = _normal(table, b, pose.R_B)
    d = opposite(rotate_back(pose.R_A, n))
    core = core_of(table, a)
    own = support_point(core.kind, core.size, table.vertices, core.first, core.count, d)
    own = along(own, rounding(table, a), d)
    witness = rotate(pose.R_A, own)
    distance = dot(n, minus(witness, pose.p)) - (offset + table.margin[b])
    scale = sum_of_sizes(pose.p) + abs(offset) + table.radius[a] + table.margin[b]
    write(out, distance, opposite(n), witness, SAT_ROUND_OFF * scale)
    out[FEATURE_TYPE_B] = FACE


@device
def half_spaces_contact(table: Any, a: int, b: int, pose: PairPose, out: Any) -> None:
    """Write the contact of two half-spaces, which have a distance only if they face each other.

    Otherwise no translation parts them: the distance is -inf, and both witness points are one point inside both.
    """
    p = pose.p
    reach_a, reach_b = table.size[a, 3] + table.margin[a], table.size[b, 3] + table.margin[b]
    na, nb = _normal(table, a, pose.R_A), _normal(table, b, pose.R_B)
    if max(abs(na[0] + nb[0]), abs(na[1] + nb[1]), abs(na[2] + nb[2])) <= OPPOSED:
        distance = dot(na, p) - reach_a - reach_b
        scale = sum_of_sizes(p) + abs(reach_a) + abs(reach_b)
        write(out, distance, na, scaled(na, reach_a), SAT_ROUND_OFF * scale)
    else:
        # move a point of A's plane into B: within A's plane or, if the normals are equal, to B's plane
        point = scaled(na, reach_a)
        outside = dot(nb, minus(point, p)) - reach_b
        c = cross(na, nb)
        sin2 = dot(c, c)
        if outside > 0.0 and sin2 > 0.0:
            point = along(point, outside / sin2, cross(na, c))
        elif outside > 0.0:
            point = along(p, reach_b, nb)
        d = minus(na, nb)
        length = sqrt(dot(d, d))
        normal = na
        if length > 0.0:
            normal = (d[0] / length, d[1] / length, d[2] / length)
        write(out, 0.0, normal, point, 0.0)
        out[DISTANCE] = -inf
    out[FEATURE_TYPE_A] = FACE
    out[FEATURE_TYPE_B] = FACE
