"""Any two convex shapes: GJK for the distance of the cores, EPA if they overlap, then the radii.

Growing a convex core by a sphere moves its surface along the normal, so distance and depth of the grown shapes
are exactly those of the cores minus the radii. (van den Bergen, 2003, 4.5)
"""

from __future__ import annotations

from math import inf, sqrt
from typing import Any

from collision_monitor._jit import inlined
from collision_monitor.geometry.vector import along, dot, opposite, rotate
from collision_monitor.narrow_phase.contact_row import write
from collision_monitor.narrow_phase.core import CorePair, core_length, core_pair, rounding
from collision_monitor.narrow_phase.epa import epa
from collision_monitor.narrow_phase.gjk import EXACT, Accuracy, gjk, point_on_a, simplex_point
from collision_monitor.narrow_phase.pair_pose import PairPose
from collision_monitor.narrow_phase.parallel_axes import ROUND_OFF_SLANT, axes_slant, parallel_axes_depth
from collision_monitor.narrow_phase.support_difference import support_difference
from collision_monitor.narrow_phase.work_memory import MAX_VERTICES, P_AB, R_AB, SPARE, WEIGHTS
from collision_monitor.shapes.calls import core_radius
from collision_monitor.shapes.registry import CURVED
from collision_monitor.tolerances import EPA_CURVED, EPA_CURVED_POINTS, EPA_POLYTOPE, GJK_TOUCHING, SAT_ROUND_OFF


@inlined
def _place(pose: PairPose, work: Any) -> None:
    """Write the pose of B in A's frame to the scratch memory."""
    RA, RB = pose.R_A, pose.R_B
    px, py, pz = pose.p
    for i in range(3):
        for j in range(3):
            work[R_AB + 3 * i + j] = RA[0, i] * RB[0, j] + RA[1, i] * RB[1, j] + RA[2, i] * RB[2, j]
        work[P_AB + i] = RA[0, i] * px + RA[1, i] * py + RA[2, i] * pz


@inlined
def convex_separation(table: Any, a: int, b: int, pose: PairPose, accuracy: Accuracy, out: Any, work: Any) -> float:
    """Certified lower bound of the distance (m), <= 0 if they overlap or touch; its direction is in out[0:3]."""
    _place(pose, work)
    px, py, pz = pose.p
    radii = table.margin[a] + table.margin[b] + core_radius(table, a) + core_radius(table, b)
    size = core_length(table, a) + core_length(table, b)
    wanted = Accuracy(accuracy.near + radii, accuracy.slack)
    _, lower, normal = gjk(core_pair(table, a, b), work, size, inf, wanted)
    out[0], out[1], out[2] = rotate(pose.R_A, normal)
    slack = SAT_ROUND_OFF * (size + abs(px) + abs(py) + abs(pz))
    return max(lower, 0.0) - radii - slack


@inlined
def convex_contact(table: Any, a: int, b: int, pose: PairPose, limit: float, out: Any, work: Any) -> bool:
    """Write the contact; False, with out undefined, as soon as the distance is certified to exceed `limit` (m)."""
    size = core_length(table, a) + core_length(table, b)
    return cores_contact(core_pair(table, a, b), (rounding(table, a), rounding(table, b)), size, pose, limit, out, work)


@inlined
def cores_contact(
    cores: CorePair, radii: tuple[float, float], size: float, pose: PairPose, limit: float, out: Any, work: Any
) -> bool:
    """`convex_contact` of two cores with the radii (m) that round them; size: sum of their bounding radii (m)."""
    _place(pose, work)
    px, py, pz = pose.p
    A, B = cores.A, cores.B
    ra, rb = radii
    round_off = SAT_ROUND_OFF * (size + abs(px) + abs(py) + abs(pz) + ra + rb)
    count, lower, normal = gjk(cores, work, size, limit + ra + rb + round_off, EXACT)
    if count == 0:
        return False
    curved = CURVED[A.kind] or CURVED[B.kind]
    if lower > 0.0:
        # the length of a point of B - A: an upper bound even if the simplex is too thin for its own length to be one
        w = point_a = (0.0, 0.0, 0.0)
        for k in range(count):
            weight = work[WEIGHTS + k]
            w = along(w, weight, simplex_point(work, k))
            point_a = along(point_a, weight, point_on_a(work, k))
        length = sqrt(dot(w, w))
        distance = max(length, lower)
        bound = distance - lower
        if curved and length > 0.0:
            # On round surfaces, the direction that proves the bound differs a little from the one between the points.
            # As normal, the first puts B's point beside B's surface; the second shortens the gap along the normal.
            x, y, z = normal
            beside = sqrt((w[0] - length * x) ** 2 + (w[1] - length * y) ** 2 + (w[2] - length * z) ** 2)
            between = (w[0] / length, w[1] / length, w[2] / length)
            d = support_difference(cores, work, opposite(between), SPARE)
            if distance - dot(between, d) < beside:
                normal = between
    else:
        off = axes_slant(A, B, work) * size
        if off <= ROUND_OFF_SLANT * size:
            depth, normal, point_a = parallel_axes_depth(A, B, work, size)
            bound = off
        else:
            tolerance, most = (EPA_CURVED, EPA_CURVED_POINTS) if curved else (EPA_POLYTOPE, MAX_VERTICES)
            depth, least, normal, point_a = epa(cores, work, size, count, tolerance, most)
            bound = abs(depth - least)
            if off < bound:  # all directions around the axes nearly tie, which EPA cannot tell from a deeper one
                depth, normal, point_a = parallel_axes_depth(A, B, work, size)
                bound = off
        distance = -depth
        bound += GJK_TOUCHING * size
    bound += round_off
    # the radius moves A's surface that much along the normal
    point_a = along(point_a, ra, normal)
    write(out, distance - ra - rb, rotate(pose.R_A, normal), rotate(pose.R_A, point_a), bound)
    return True
