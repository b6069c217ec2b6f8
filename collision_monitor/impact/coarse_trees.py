"""When two moving trees are near, by their boxes alone: the search of tree_impact.py, ended early.

It ends as soon as two boxes are so small and so near that their triangles are within a gap of some cm.
"""

from __future__ import annotations

from math import inf, sqrt
from typing import Any, Final, NamedTuple

from collision_monitor._jit import device, inlined
from collision_monitor.geometry.vector import dot
from collision_monitor.impact.impact_record import CLEAR, UNRESOLVED
from collision_monitor.impact.mesh_pair import root_of, triangles_contact
from collision_monitor.impact.tree_impact import HEAP, open_box, pop_first, push_pair, times_of, tree_approach_at
from collision_monitor.meshes.advance.leaf_times import leaf_time
from collision_monitor.meshes.distance.contact import reach_in
from collision_monitor.meshes.distance.depth_range import depth_range
from collision_monitor.meshes.distance.nearest import BOUNDS, PAIRS, PLACE_A, PLACE_B, size_of
from collision_monitor.meshes.layout import CENTER, CHILD, HALF, WIDTH
from collision_monitor.meshes.placing import place_point, relative
from collision_monitor.motion.bodies import place_shape
from collision_monitor.narrow_phase.contact_row import BOUND, DISTANCE, POINT_A, POINT_B
from collision_monitor.narrow_phase.pair_pose import PairPose

KEEP: Final = 1.0
"""A pair of boxes is kept while its next step allows a motion longer than this part of the box that would be opened."""

STEPS: Final = 500
"""Most pairs of boxes to examine, 0.15 ms. The time until which the pair is apart by then is reported."""

SHARE: Final = 0.2
"""Largest gap at which the search ends, as a part of the distance that the bodies move until then."""

DUE: Final = 1.0
"""Gap at which the search of a pair that is due ends, as a part of the distance that the bodies move in a step."""

TOO_MANY: Final = 253
"""In place of a status: more pairs of boxes wait than there is room for."""


class SearchEnd(NamedTuple):
    """How near two bodies have to be, so that their search ends."""

    tolerance: Any  # m: largest gap; 0: every search is a full one
    period: Any  # s since the step before

    @property
    def is_allowed(self) -> bool:
        """Whether searches may end early."""
        return bool(self.tolerance > 0.0)


@inlined
def nearness(near, speed, elapsed, query):
    """Gap (m) at which the search ends, for a time `elapsed` (s) after now and a speed (m/s). near: Nearness."""
    return max(min(near.tolerance, speed * max(SHARE * elapsed, DUE * near.period)), query.tolerance)


@inlined
def box_radius(blocks, block, member):
    """Half of the diagonal of a box (m)."""
    x, y, z = blocks[block, HALF, member], blocks[block, HALF + 1, member], blocks[block, HALF + 2, member]
    return sqrt(x * x + y * y + z * z)


@device
def trees_near(table, parts, pair, now, window, tube, query, near, scratch):
    """Time in a window (begin, end; s) until which two trees stay apart; CLEAR, UNRESOLVED or TOO_MANY; a gap (m).

    UNRESOLVED: at that time they may be within the gap, which is at most the tolerance (m), and shorter near `now` (s).
    pair: ShapePair. The tube's time begins with the window.
    """
    begin, end = times_of(window)
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
        p, move = tree_approach_at(table, parts, pair, t, wanted, tube.growth, end, scratch)
        X = relative(scratch.rotation[2], scratch.rotation[3], p)
        c = place_point(X, (blocks[b, CENTER, j], blocks[b, CENTER + 1, j], blocks[b, CENTER + 2, j]))
        w = c[0] - blocks[a, CENTER, i], c[1] - blocks[a, CENTER + 1, i], c[2] - blocks[a, CENTER + 2, i]
        speed = sqrt(dot(move.v, move.v)) + move.growth
        speed += sqrt(move.bend_a) * reach_in(blocks, root_a) + sqrt(move.bend_b) * reach_in(blocks, root_b)
        gap = nearness(near, speed, t - now, query)
        if steps > STEPS or sqrt(dot(w, w)) + box_radius(blocks, a, i) + box_radius(blocks, b, j) <= gap + move.start:
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
        in_b, block, size, soon = open_box(blocks, (root_a, a, i, child_a), (root_b, b, j, child_b), X, move, work)
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
def pose_at(table, parts, pair, t, scratch):
    """Pose (PairPose) of a pair of shapes at time t (s)."""
    p, _ = tree_approach_at(table, parts, pair, t, 0.0, 0.0, t, scratch)
    return PairPose(scratch.rotation[2], scratch.rotation[3], p)


@device
def trees_overlap(table, parts, pair, t, allowed, scratch):
    """Whether triangles of a pair of trees overlap at time t (s) by more than `allowed` (m); writes their contact.

    The contact, about A's origin, stays in scratch.out.
    """
    a, b = pair.a, pair.b
    pose, out, answer = pose_at(table, parts, pair, t, scratch), scratch.out, scratch.answer
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
