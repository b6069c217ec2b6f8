"""When a moving tree and a moving solid are near: the search of solid_impact.py, ended early as in coarse_trees.py."""

from __future__ import annotations

from math import inf, sqrt

from collision_monitor._jit import device
from collision_monitor.geometry.vector import cross, dot, minus
from collision_monitor.impact.coarse_trees import KEEP, STEPS, TOO_MANY, box_radius, nearness, pose_at
from collision_monitor.impact.impact_record import CLEAR, UNRESOLVED
from collision_monitor.impact.mesh_pair import is_mesh, root_of
from collision_monitor.impact.tree_impact import HEAP, pop_first, push_pair, times_of, tree_approach_at
from collision_monitor.meshes.boxes import half_of
from collision_monitor.meshes.distance.contact import reach_in
from collision_monitor.meshes.distance.nearest import BOUNDS, PAIRS, size_of
from collision_monitor.meshes.distance.solid import (
    MovingSolid,
    SolidMemory,
    box_reach_along,
    center_of,
    leaf_solid_time,
    solid_time,
)
from collision_monitor.meshes.distance.solid_range import solid_range
from collision_monitor.meshes.layout import CHILD, WIDTH
from collision_monitor.meshes.placing import inverse, place_point, relative
from collision_monitor.motion.bodies import place_shape
from collision_monitor.narrow_phase.contact_row import BOUND, POINT_A, POINT_B
from collision_monitor.narrow_phase.core import core_length
from collision_monitor.narrow_phase.dispatch import mirror
from collision_monitor.narrow_phase.pair_pose import PairPose, swapped
from collision_monitor.shapes.calls import point_distance_range


@device
def _box_time(blocks, block, k, solid):
    """`box_time` along a direction that is better for cones and ellipsoids."""
    table, b, _, X, move = solid
    c, e = center_of(blocks, block, k), half_of(blocks, block, k)
    lower, _, n = point_distance_range(table, b, place_point(inverse(X), c))
    n = minus((X.x, X.y, X.z), place_point(X, n))
    gap, turn = lower - box_reach_along(blocks, block, k, n), box_reach_along(blocks, block, k, cross(n, move.w_a))
    return solid_time(table, b, X, n, gap - move.start, c, sqrt(dot(e, e)), turn, move)


@device
def solid_near(table, parts, pair, now, window, tube, query, near, scratch):
    """`trees_near` of a tree and a solid, which may not be swapped: pair has both motions, then both slots."""
    a, b = pair[2], pair[3]
    begin, end = times_of(window)
    blocks, work, root = table.blocks, scratch.tree, root_of(table, a)
    memory, own = SolidMemory(scratch.triangle, scratch.work, work), core_length(table, b)
    waiting = push_pair(work, 0, begin, float(WIDTH * root), 0.0, 0.0)
    steps = 0
    while waiting > 0:
        t, place = work[PAIRS], work[PAIRS + 1]
        waiting = pop_first(work, waiting)
        steps += 1
        margin = query.margin + tube.start + tube.growth * (t - begin)
        p, move = tree_approach_at(table, parts, pair, t, margin, tube.growth, end, scratch)
        R_a, R_b = scratch.rotation[2], scratch.rotation[3]
        X = relative(R_a, R_b, p)
        solid = MovingSolid(table, b, PairPose(R_a, R_b, p), X, move)
        i, k = int(place) // WIDTH, int(place) % WIDTH
        child, size = blocks[i, CHILD, k], size_of(blocks, i, k)
        block = root + int(abs(child))
        speed = sqrt(dot(move.v, move.v)) + move.growth
        speed += sqrt(move.bend_a) * reach_in(blocks, root) + sqrt(move.bend_b) * own
        gap = nearness(near, speed, t - now, query)
        _, most, _ = point_distance_range(table, b, place_point(inverse(X), center_of(blocks, i, k)))
        if steps > STEPS or most + box_radius(blocks, i, k) <= gap + move.start:
            return t, UNRESOLVED, gap
        soon = inf
        if child < 0.0:
            soon, _ = leaf_solid_time(blocks, block, solid, gap, (KEEP * size + gap) / speed, memory)
            if t + soon <= t:
                return t, UNRESOLVED, gap
        else:
            for m in range(WIDTH):
                if blocks[block, CHILD, m] != 0.0:
                    work[BOUNDS + m] = _box_time(blocks, block, m, solid)
                    soon = min(soon, work[BOUNDS + m])
        if child < 0.0 or (soon * speed > KEEP * size and t + soon > t):
            if t + soon < end:
                waiting = push_pair(work, waiting, t + soon, place, 0.0, 0.0)
            continue
        if waiting + WIDTH > HEAP:
            return t, TOO_MANY, gap
        for m in range(WIDTH):
            if blocks[block, CHILD, m] != 0.0 and t + work[BOUNDS + m] < end:
                waiting = push_pair(work, waiting, t + work[BOUNDS + m], float(WIDTH * block + m), 0.0, 0.0)
    return end, CLEAR, 0.0


@device
def solid_overlaps(table, parts, pair, t, allowed, scratch):
    """`trees_overlap` of a tree and a solid, in any order (ShapePair)."""
    a, b, pose = pair.a, pair.b, pose_at(table, parts, pair, t, scratch)
    out, memory, p = scratch.out, SolidMemory(scratch.triangle, scratch.work, scratch.tree), pose.p
    is_swapped = not is_mesh(table, a)
    if is_swapped:
        a, b = b, a
        pose = swapped(pose)
    _, most = solid_range(table.blocks, root_of(table, a), table.margin[a], table, b, pose, inf, out, memory)
    if not most + out[BOUND] + allowed <= 0.0:
        return False
    if is_swapped:
        mirror(out, p)
    offset = place_shape(table, parts, pair.a, scratch.rotation[0], scratch.rotation[2])
    for c in range(3):
        out[POINT_A + c] += offset[c]
        out[POINT_B + c] += offset[c]
    return True
