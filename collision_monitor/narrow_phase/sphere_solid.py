"""Sphere against a solid whose distance from a point has a closed form (`Kind.exact`): the centre's distance."""

from __future__ import annotations

from typing import Any

from collision_monitor._jit import inlined
from collision_monitor.geometry.vector import opposite, rotate, rotate_back, scaled, sum_of_sizes
from collision_monitor.narrow_phase.contact_row import FEATURE_TYPE_A, write
from collision_monitor.narrow_phase.pair_pose import PairPose
from collision_monitor.shapes.calls import point_distance_range
from collision_monitor.shapes.feature_types import SURFACE
from collision_monitor.tolerances import SAT_ROUND_OFF


@inlined
def sphere_solid_contact(table: Any, a: int, b: int, pose: PairPose, out: Any) -> None:
    """Write the contact of sphere a and solid b."""
    radius, margin = table.size[a, 0] + table.margin[a], table.margin[b]
    distance, _, outward = point_distance_range(table, b, opposite(rotate_back(pose.R_B, pose.p)))
    n = opposite(rotate(pose.R_B, outward))
    bound = SAT_ROUND_OFF * (sum_of_sizes(pose.p) + table.radius[b] + radius)
    write(out, distance - radius - margin, n, scaled(n, radius), bound)
    out[FEATURE_TYPE_A] = SURFACE
