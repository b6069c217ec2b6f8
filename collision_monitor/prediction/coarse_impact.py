"""First impacts of meshes that are not due yet: only until when their boxes stay apart (`mesh_impact_tolerance`).

The search of tree_impact.py, ended as soon as two boxes are so small and so near that their triangles are within a gap
of some cm. The lower end is as certain as that of a full search. A collision is certain if triangles meet at one of a
few later times; else the upper end is open. Pairs that are due get a full search, so far pairs are coarse and near
pairs exact.
"""

from __future__ import annotations

from math import inf, sqrt
from typing import Final

from collision_monitor._jit import device, inlined, kernel, outlined
from collision_monitor.meshes.approach import seen_from_b
from collision_monitor.meshes.box_times import box_times
from collision_monitor.meshes.contact import reach_in
from collision_monitor.meshes.depth_range import depth_range
from collision_monitor.meshes.inside import OUTSIDE
from collision_monitor.meshes.layout import CENTER, CHILD, HALF, WIDTH
from collision_monitor.meshes.leaf_times import leaf_time
from collision_monitor.meshes.nearest import BOUNDS, PAIRS, PLACE_A, PLACE_B, opens_b, size_of
from collision_monitor.meshes.placing import inverse, place_point, relative
from collision_monitor.narrow_phase.contact_row import BOUND, DISTANCE, NORMAL, POINT_A, POINT_B
from collision_monitor.narrow_phase.pair_pose import PairPose
from collision_monitor.narrow_phase.vector import dot
from collision_monitor.prediction.bodies import place_shape
from collision_monitor.prediction.body_impact import ShapePair, Tube, closing_speed, tube_of
from collision_monitor.prediction.impact_record import (
    BOUND_ONLY,
    CLEAR,
    CONSERVATIVE_ADVANCEMENT,
    HIT,
    UNRESOLVED,
    write_pair,
)
from collision_monitor.prediction.mesh_pair import enclosure, has_mesh, have_trees, root_of, triangles_contact
from collision_monitor.prediction.motion import half_acceleration, relative_position, relative_velocity
from collision_monitor.prediction.pair_impacts import window_of
from collision_monitor.prediction.sphere_interval import approach_at, meeting_of_spheres, sphere_interval
from collision_monitor.prediction.tree_impact import HEAP, pop_first, push_pair
from collision_monitor.prediction.tree_impact import approach_at as approach_of_shapes

KEEP: Final = 1.0
"""A pair of boxes is kept while its next step allows a motion longer than this part of the box that would be opened."""

STEPS: Final = 500
"""Most pairs of boxes to examine, 0.15 ms. The time until which the pair is apart by then is reported."""

SHARE: Final = 0.2
"""Largest gap at which the search ends, as a part of the distance that the bodies move until then."""

TRIES: Final = (1.5, 4.0)
"""Times after the lower end at which triangles may meet: those in which the bodies move by so many gaps."""

TOO_MANY: Final = 253
"""In place of a status: more pairs of boxes wait than there is room for."""


@inlined
def _radius_of(blocks, block, member):
    """Half of the diagonal of a box (m)."""
    x, y, z = blocks[block, HALF, member], blocks[block, HALF + 1, member], blocks[block, HALF + 2, member]
    return sqrt(x * x + y * y + z * z)


@device
def _boxes_meet(table, parts, pair, now, window, tube, query, tolerance, scratch):
    """Time in a window (begin, end; s) until which two trees stay apart; CLEAR, UNRESOLVED or TOO_MANY; a gap (m).

    UNRESOLVED: at that time they may be within the gap, which is at most the tolerance (m), and shorter near `now` (s).
    pair: ShapePair. The tube's time begins with the window.
    """
    begin, end = window
    blocks, work = table.blocks, scratch.tree
    root_a, root_b = root_of(table, pair.a), root_of(table, pair.b)
    waiting = push_pair(work, 0, begin, float(WIDTH * root_a), float(WIDTH * root_b), -1.0)
    steps = 0
    while waiting > 0:
        t, place_a, place_b, triangles = work[PAIRS], work[PAIRS + 1], work[PAIRS + 2], int(work[PAIRS + 3])
        waiting = pop_first(work, waiting)
        steps += 1
        a, i, b, j = int(place_a) // WIDTH, int(place_a) % WIDTH, int(place_b) // WIDTH, int(place_b) % WIDTH
        child_a, child_b = blocks[a, CHILD, i], blocks[b, CHILD, j]
        wanted = query.margin + tube.start + tube.growth * (t - begin)
        p, move = approach_of_shapes(table, parts, pair, t, wanted, tube.growth, end, scratch)
        X = relative(scratch.rotation[2], scratch.rotation[3], p)
        c = place_point(X, (blocks[b, CENTER, j], blocks[b, CENTER + 1, j], blocks[b, CENTER + 2, j]))
        w = c[0] - blocks[a, CENTER, i], c[1] - blocks[a, CENTER + 1, i], c[2] - blocks[a, CENTER + 2, i]
        speed = sqrt(dot(move.v, move.v)) + move.growth
        speed += sqrt(move.bend_a) * reach_in(blocks, root_a) + sqrt(move.bend_b) * reach_in(blocks, root_b)
        gap = max(min(tolerance, SHARE * speed * (t - now)), query.tolerance)
        if steps > STEPS or sqrt(dot(w, w)) + _radius_of(blocks, a, i) + _radius_of(blocks, b, j) <= gap + move.start:
            return t, UNRESOLVED, gap
        if child_a < 0.0 and child_b < 0.0:
            leaf_a, leaf_b = root_a - int(child_a), root_b - int(child_b)
            size = max(size_of(blocks, a, i), size_of(blocks, b, j))
            soon, triangles = leaf_time(
                blocks, int(place_a), leaf_a, blocks, int(place_b), leaf_b, X, move, gap, KEEP * size / speed,
                triangles, work,
            )  # fmt: skip
            if t + soon <= t:
                return t, UNRESOLVED, gap
            if t + soon < end:
                waiting = push_pair(work, waiting, t + soon, place_a, place_b, float(triangles))
            continue
        in_b = opens_b(blocks, a, i, child_a, blocks, b, j, child_b)
        if in_b:
            block, size = root_b + int(child_b), size_of(blocks, b, j)
            box_times(blocks, a, i, blocks, block, X, move, work, BOUNDS)
        else:
            block, size = root_a + int(child_a), size_of(blocks, a, i)
            box_times(blocks, b, j, blocks, block, inverse(X), seen_from_b(X, move), work, BOUNDS)
        soon = inf
        for k in range(WIDTH):
            if blocks[block, CHILD, k] != 0.0:
                soon = min(soon, work[BOUNDS + k])
        if soon * speed > KEEP * size and t + soon > t:
            if t + soon < end:
                waiting = push_pair(work, waiting, t + soon, place_a, place_b, -1.0)
            continue
        if waiting + WIDTH > HEAP:
            return t, TOO_MANY, gap
        for k in range(WIDTH):
            time = t + work[BOUNDS + k]
            if blocks[block, CHILD, k] != 0.0 and time < end:
                child = float(WIDTH * block + k)
                first, second = (place_a, child) if in_b else (child, place_b)
                waiting = push_pair(work, waiting, time, first, second, -1.0)
    return end, CLEAR, 0.0


@device
def _pose_at(table, parts, pair, t, scratch):
    """Pose (PairPose) of a pair of shapes at time t (s)."""
    p, _ = approach_of_shapes(table, parts, pair, t, 0.0, 0.0, t, scratch)
    return PairPose(scratch.rotation[2], scratch.rotation[3], p)


@device
def _triangles_meet(table, parts, pair, t, allowed, scratch):
    """Whether triangles of a pair of trees overlap at time t (s) by more than `allowed` (m); writes their contact.

    The contact, about A's origin, stays in scratch.out.
    """
    a, b = pair.a, pair.b
    pose, out, answer = _pose_at(table, parts, pair, t, scratch), scratch.out, scratch.answer
    X = relative(pose.R_A, pose.R_B, pose.p)
    found, _ = depth_range(table.blocks, root_of(table, a), root_of(table, b), X, inf, answer, scratch.tree)
    if found < 0.0:
        return False
    triangles_contact(table, a, b, pose, (int(answer[PLACE_A]), int(answer[PLACE_B])), out)
    if out[DISTANCE] + out[BOUND] + allowed > 0.0:
        return False
    offset = place_shape(table, parts, a, scratch.rotation[0], scratch.rotation[2])
    for c in range(3):
        out[POINT_A + c] += offset[c]
        out[POINT_B + c] += offset[c]
    return True


@device
def _write_hit(pair, t, event, out):
    """Set what a certain collision at time t (s) has, from the contact of two triangles about A's origin."""
    A, B = pair.A, pair.B
    ta = t - A.time
    event.upper, event.status, event.method = t, HIT, CONSERVATIVE_ADVANCEMENT
    event.point_x = A.x + (A.vx + 0.5 * A.ax * ta) * ta + 0.5 * (out[POINT_A] + out[POINT_B])
    event.point_y = A.y + (A.vy + 0.5 * A.ay * ta) * ta + 0.5 * (out[POINT_A + 1] + out[POINT_B + 1])
    event.point_z = A.z + (A.vz + 0.5 * A.az * ta) * ta + 0.5 * (out[POINT_A + 2] + out[POINT_B + 2])
    event.normal_x, event.normal_y, event.normal_z = out[NORMAL], out[NORMAL + 1], out[NORMAL + 2]
    v, p = relative_velocity(A, B, t), relative_position(A, B, t)
    event.closing_speed = closing_speed(v, (A.wx, A.wy, A.wz), (B.wx, B.wy, B.wz), p, out)


@outlined
def coarse_impact(multibody, i, j, window, query, tolerance, scratch, event):
    """Write a bound on the first impact of two bodies of one tree each into the IMPACT record `event`.

    event.status = CLEAR if there is none. Returns False if only a full search can tell, for example if one of the
    bodies may be inside the other. tolerance: gap (m), at most the radius of the smaller body.
    """
    table, parts, bodies = multibody
    begin, end = window
    if bodies.id[i] > bodies.id[j]:
        i, j = j, i
    A, B = bodies.motion[i], bodies.motion[j]
    event.status = CLEAR
    tube, approach = tube_of(A, B, begin), approach_at(A, B, begin)
    bent = half_acceleration(A, B) * (end - begin)
    reach = A.radius + B.radius + query.margin
    first, last = sphere_interval(approach.p, approach.v, reach + tube.start, tube.growth + bent, end - begin, 1.0)
    if first > last:
        return True
    pair = ShapePair(A, B, bodies.first_shape[i], bodies.first_shape[j])
    start, stop, tolerance = begin + first, begin + last, min(tolerance, A.radius, B.radius)
    there = Tube(tube.start + tube.growth * first, tube.growth)
    lower, status, gap = _boxes_meet(table, parts, pair, begin, (start, stop), there, query, tolerance, scratch)
    if status == TOO_MANY:
        return False
    if lower > start or status == CLEAR:
        pose = _pose_at(table, parts, pair, start, scratch)
        if enclosure(table, pair.a, pair.b, pose, scratch) != OUTSIDE:
            return False
    if status == CLEAR:
        return True
    write_pair(bodies, i, j, event)
    event.shape_i, event.shape_j = pair.a, pair.b
    event.lower, event.upper, event.status, event.method = lower, inf, UNRESOLVED, BOUND_ONLY
    v = relative_velocity(A, B, lower)
    speed = sqrt(dot(v, v))
    for ahead in TRIES:
        t = lower + ahead * gap / speed if speed > 0.0 else inf
        allowed = tube.start + tube.growth * (t - begin) - query.margin
        if t <= stop and _triangles_meet(table, parts, pair, t, allowed, scratch):
            _write_hit(pair, t, event, scratch.out)
            return True
    meeting_of_spheres(A, B, approach, begin, lower - begin, event)
    return True


@inlined
def are_trees(multibody, i, j):
    """Whether two bodies are one shape each, with a tree, one of them a mesh or a cloud."""
    table, parts, bodies = multibody
    a, b = bodies.first_shape[i], bodies.first_shape[j]
    return parts.next[a] < 0 and parts.next[b] < 0 and has_mesh(table, a, b) and have_trees(table, a, b)


@kernel
def bound_meshes(multibody, pairs, now, query, tolerance, events, rest, scratch):
    """Write bounds on the first impacts of pairs (P, 2) of trees into events (IMPACT), and the other pairs into rest.

    rest (P, 2). Times as for `predict_pairs`. tolerance: gap (m) that may remain. Returns (number of impacts, number of
    other pairs, number of searches).
    """
    n = left = made = 0
    for k in range(pairs.shape[0]):
        i, j = pairs[k, 0], pairs[k, 1]
        if are_trees(multibody, i, j):
            window = window_of(multibody.bodies, i, j, now)
            if window.begin > now and window.begin >= window.end:
                continue
            made += 1
            if coarse_impact(multibody, i, j, window, query, tolerance, scratch, events[n]):
                if events[n].status != CLEAR:
                    n += 1
                continue
        rest[left, 0], rest[left, 1] = i, j
        left += 1
    return n, left, made
