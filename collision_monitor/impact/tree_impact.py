"""First impact of two moving trees, by conservative advancement of each pair of boxes for itself.

Pairs of boxes wait in the order of the times until which they certainly stay apart. The first one is examined at its
time: it gets a later one, or its children take its place. So pairs far apart take long steps, which are never repeated,
and only those of the triangles that nearly meet take short ones.
(Mirtich, 1996; Tang, Kim, Manocha, C2A: controlled conservative advancement for continuous collision detection, 2009;
Hubbard, Collision detection for interactive graphics applications, 1995: a heap of times)
"""

from __future__ import annotations

from math import inf, sqrt
from typing import Any, Final, NamedTuple

from collision_monitor._jit import device, inlined, outlined
from collision_monitor.geometry.vector import cross, dot, magnitude, minus, plus, rotate_back
from collision_monitor.impact.impact_record import CLEAR, HIT, UNRESOLVED
from collision_monitor.meshes.advance.approach import Approach, seen_from_b
from collision_monitor.meshes.advance.box_times import box_times
from collision_monitor.meshes.advance.leaf_times import leaf_time
from collision_monitor.meshes.distance.contact import reach_in
from collision_monitor.meshes.distance.nearest import BOUNDS, MOST_PAIRS, PAIRS, PLACE_A, PLACE_B, opens_b, size_of
from collision_monitor.meshes.layout import CENTER, CHILD, HALF, WIDTH
from collision_monitor.meshes.placing import inverse, place_point, relative
from collision_monitor.motion.motion import (
    are_straight,
    change_at,
    half_acceleration,
    most_turning,
    smooth_until,
)
from collision_monitor.motion.placed_pair import place_pair
from collision_monitor.shapes.shape_table import TREE
from collision_monitor.tolerances import EPSILON

KEEP: Final = 0.2
"""A pair of boxes is kept while its next step allows a motion longer than this part of the box that would be opened.
Larger: more boxes are opened. Smaller: more steps."""

STEPS: Final = 500
"""Pairs of boxes to examine for each distance query that is allowed, 0.15 ms. Hostile meshes, such as a million
triangles in a point, need more than any limit; their impact is UNRESOLVED."""

MOST_TURNED: Final = 1e4
"""rad: 1,600 turns. A body that turns farther in the time of a search is faulty."""

MOST_SWEPT: Final = 1e6
"""Radii of the smaller body by which points of the other one may move as it turns. Beyond, it is faulty as well."""

FEWER_STEPS: Final = 256
"""Divisor of the STEPS for such bodies, which need more than any limit too."""

SAME: Final = 0.1
"""A pair is examined at the time of the one before unless its boxes move by more than this part of their size until its
own time: the motion of both bodies at a time costs as much as half of the boxes that it is compared with."""

ENTRY: Final = 4
"""Numbers of a waiting pair of boxes: time, both places, and the pair of triangles that limited its last step."""

HEAP: Final = 2 * MOST_PAIRS // ENTRY
"""Most pairs of boxes that wait. The others are found again by a new search from the earliest time of any of them."""


LEAST_DURATION: Final = 1e-300
"""s: least duration of a search."""

UNBOUNDED: Final = 1e300
"""m/s^3: in place of a bound on the jerk of motions that come to rest or change how fast they turn."""

KEEP_EARLY: Final = 1.0
"""KEEP of a search that ends early, whose steps are long."""

SHARE: Final = 0.2
"""Largest gap at which a search ends early, as a part of the distance that the bodies move until then."""

DUE: Final = 1.0
"""Gap at which the search of a pair that is due ends, as a part of the distance that the bodies move in a step."""


class SearchEnd(NamedTuple):
    """How near two bodies have to be, so that their search ends early: until then they are only known to be apart."""

    tolerance: Any  # m: largest gap; 0: the search is a full one
    period: Any  # s since the step before
    now: Any  # s: time of the step

    @property
    def is_allowed(self) -> bool:
        """Whether searches may end early."""
        return bool(self.tolerance > 0.0)


FULL: Final = SearchEnd(0.0, 0.0, 0.0)
"""A search that ends with the impact."""


@inlined
def ending_gap(ending: SearchEnd, speed: float, t: float, query: Any) -> float:
    """Gap (m) at which a search ends at time t (s), for bodies of a relative speed (m/s)."""
    near = speed * max(SHARE * (t - ending.now), DUE * ending.period)
    return max(min(ending.tolerance, near), query.tolerance)


@inlined
def steps_of(A: Any, B: Any, duration: float, query: Any, ending: SearchEnd) -> int:
    """Most boxes that a search of a duration (s) examines. It knows then until when the bodies are apart."""
    if ending.tolerance > 0.0:
        return STEPS
    return query.iterations * STEPS // (FEWER_STEPS if spins(A, B, duration) else 1)


@inlined
def box_radius(blocks: Any, block: int, member: int) -> float:
    """Half of the diagonal of a box (m)."""
    x, y, z = blocks[block, HALF, member], blocks[block, HALF + 1, member], blocks[block, HALF + 2, member]
    return sqrt(x * x + y * y + z * z)


@inlined
def times_of(window: Any) -> tuple[float, float]:
    """Begin and end of a search in a window (s). The end is later than the begin, so that an instant is examined too.

    Pairs of boxes wait only for times before the end. A window is an instant where the profile has no horizon.
    """
    begin, end = window
    return begin, max(end, begin + EPSILON * abs(begin) + LEAST_DURATION)


@device
def push_pair(heap: Any, count: int, t: float, place_a: float, place_b: float, pair: float) -> int:
    """Add a pair of boxes to the heap, which begins at PAIRS; return its new length."""
    k = count
    while k > 0 and heap[PAIRS + ENTRY * ((k - 1) >> 1)] > t:
        above = (k - 1) >> 1
        for c in range(ENTRY):
            heap[PAIRS + ENTRY * k + c] = heap[PAIRS + ENTRY * above + c]
        k = above
    at = PAIRS + ENTRY * k
    heap[at], heap[at + 1], heap[at + 2], heap[at + 3] = t, place_a, place_b, pair
    return count + 1


@device
def pop_first(heap: Any, count: int) -> int:
    """Remove the pair of boxes with the least time; return the new length."""
    count -= 1
    last = PAIRS + ENTRY * count
    k, below = 0, 1
    while below < count:
        if below + 1 < count and heap[PAIRS + ENTRY * (below + 1)] < heap[PAIRS + ENTRY * below]:
            below += 1
        if heap[PAIRS + ENTRY * below] >= heap[last]:
            break
        for c in range(ENTRY):
            heap[PAIRS + ENTRY * k + c] = heap[PAIRS + ENTRY * below + c]
        k, below = below, 2 * below + 1
    for c in range(ENTRY):
        heap[PAIRS + ENTRY * k + c] = heap[last + c]
    return count


@inlined
def tree_approach_at(
    table: Any, parts: Any, pair: Any, t: float, margin: float, growth: float, until: float, scratch: Any
) -> Any:
    """Position of shape b's origin relative to that of a in world axes (m), and the Approach of both in a's axes.

    Writes the rotations of the shapes to world axes into scratch.rotation[2] and [3]. margin: gap that counts as
    contact (m). until: time at which the search ends (s).
    """
    A, B, a, b = pair
    R_a = scratch.rotation[2]
    o_a, o_b, _, state = place_pair(table, parts, pair, t, scratch)
    p, v, w_a, w_b, _, _ = state
    # the shapes' origins turn about those of their bodies
    turn_a, turn_b = cross(w_a, o_a), cross(w_b, o_b)
    change = change_at(A, B, state, t, until - t)
    own, jerk = change.acceleration, change.jerk
    bend_a, bend_b = dot(w_a, w_a), dot(w_b, w_b)
    jerk_a, jerk_b = bend_a * sqrt(bend_a), bend_b * sqrt(bend_b)
    arm_a, arm_b = sqrt(dot(o_a, o_a)), sqrt(dot(o_b, o_b))
    bend = sqrt(dot(own, own))
    if not are_straight(A, B):
        bend = 2.0 * half_acceleration(A, B, t, until)
        harder_a, harder_b = magnitude(change.turning_a), magnitude(change.turning_b)
        bend_a, bend_b = most_turning(A, t, until) ** 2 + harder_a, most_turning(B, t, until) ** 2 + harder_b
        if harder_a + harder_b > 0.0 or smooth_until(A, B, t) < until:
            jerk = UNBOUNDED  # the largest acceleration of any time bounds the gaps alone
    return minus(plus(p, o_b), o_a), Approach(
        rotate_back(R_a, minus(plus(v, turn_b), turn_a)),
        rotate_back(R_a, minus(plus(own, cross(w_b, turn_b)), cross(w_a, turn_a))),
        rotate_back(R_a, w_a),
        rotate_back(R_a, w_b),
        bend_a,
        bend_b,
        bend + bend_a * arm_a + bend_b * arm_b,
        jerk_a,
        jerk_b,
        jerk + jerk_a * arm_a + jerk_b * arm_b,
        margin + table.margin[a] + table.margin[b],
        growth,
        until - t,
    )


@inlined
def spins(A: Any, B: Any, duration: float) -> bool:
    """Whether two bodies turn too far within a duration (s): by MOST_TURNED, or with points that move MOST_SWEPT."""
    rate_a = sqrt(A.wx * A.wx + A.wy * A.wy + A.wz * A.wz)
    rate_b = sqrt(B.wx * B.wx + B.wy * B.wy + B.wz * B.wz)
    swept = rate_a * A.radius + rate_b * B.radius
    smaller = max(min(A.radius, B.radius), 1e-3)
    return (rate_a + rate_b) * duration > MOST_TURNED or swept * duration > MOST_SWEPT * smaller


@inlined
def open_box(blocks: Any, box_a: Any, box_b: Any, X: Any, move: Approach, work: Any) -> tuple[bool, int, float, float]:
    """Open one of two boxes: write to work[BOUNDS:] until when its members stay apart from the other box (s).

    box_a, box_b: root of the tree, block, member and child of each. Returns whether it is B's box, the block of its
    members, its size (m), and the least of these times (s).
    """
    (root_a, a, i, child_a), (root_b, b, j, child_b) = box_a, box_b
    in_b = opens_b(blocks, a, i, child_a, blocks, b, j, child_b)
    if in_b:
        block, size = root_b + int(child_b), size_of(blocks, b, j)
        box_times(blocks, root_a, WIDTH * a + i, blocks, root_b, block, X, move, work, BOUNDS)
    else:
        block, size = root_a + int(child_a), size_of(blocks, a, i)
        back = seen_from_b(X, move)
        box_times(blocks, root_b, WIDTH * b + j, blocks, root_a, block, inverse(X), back, work, BOUNDS)
    soon = inf
    for k in range(WIDTH):
        if blocks[block, CHILD, k] != 0.0:
            soon = min(soon, work[BOUNDS + k])
    return in_b, block, size, soon


@outlined
def tree_impact(
    table: Any, parts: Any, pair: Any, window: Any, tube: Any, query: Any, ending: SearchEnd, scratch: Any
) -> tuple[int, float, int, float]:
    """`shape_impact` of two shapes with trees; scratch.answer then has the places of the triangles that meet.

    A search that ends early (SearchEnd) ends, UNRESOLVED, as soon as two boxes are so small and so near that their
    triangles are within its gap; the gap (m) is in place of the guess.
    """
    begin, end = times_of(window)
    blocks, work, answer = table.blocks, scratch.tree, scratch.answer
    root_a, root_b = int(table.size[pair.a, TREE]) - 1, int(table.size[pair.b, TREE]) - 1
    place_a, place_b = float(WIDTH * root_a), float(WIDTH * root_b)
    start, most = begin, steps_of(pair.A, pair.B, end - begin, query, ending)
    is_early, gap = ending.tolerance > 0.0, query.tolerance
    keep = KEEP_EARLY if is_early else KEEP
    waiting, steps, later = push_pair(work, 0, begin, place_a, place_b, -1.0), 0, end
    now, speed = -inf, inf
    while True:
        if waiting == 0 or work[PAIRS] >= later:
            if not later < end:
                return CLEAR, end, 1 + steps // STEPS, 0.0
            place_a, place_b = float(WIDTH * root_a), float(WIDTH * root_b)
            start, later, waiting = later, end, push_pair(work, 0, later, place_a, place_b, -1.0)
        t, place_a, place_b = work[PAIRS], work[PAIRS + 1], work[PAIRS + 2]
        triangles = int(work[PAIRS + 3])
        waiting = pop_first(work, waiting)
        steps += 1
        if steps > most:
            return UNRESOLVED, t, 1 + steps // STEPS, gap
        a, i, b, j = int(place_a) // WIDTH, int(place_a) % WIDTH, int(place_b) // WIDTH, int(place_b) % WIDTH
        child_a, child_b = blocks[a, CHILD, i], blocks[b, CHILD, j]
        is_leaf = child_a < 0.0 and child_b < 0.0
        size = size_of(blocks, a, i)
        size = max(size, size_of(blocks, b, j)) if is_leaf else size
        if t != now and (t < now or not (t - now) * speed < SAME * size):
            now = t
            margin = query.margin + tube.start + tube.growth * (t - begin)
            p, move = tree_approach_at(table, parts, pair, t, margin, tube.growth, end, scratch)
            X = relative(scratch.rotation[2], scratch.rotation[3], p)
            speed = sqrt(dot(move.v, move.v)) + move.growth
            speed += sqrt(move.bend_a) * reach_in(blocks, root_a) + sqrt(move.bend_b) * reach_in(blocks, root_b)
        if is_early:
            gap = ending_gap(ending, speed, t, query)
            c = place_point(X, (blocks[b, CENTER, j], blocks[b, CENTER + 1, j], blocks[b, CENTER + 2, j]))
            w = c[0] - blocks[a, CENTER, i], c[1] - blocks[a, CENTER + 1, i], c[2] - blocks[a, CENTER + 2, i]
            if sqrt(dot(w, w)) + box_radius(blocks, a, i) + box_radius(blocks, b, j) <= gap + move.start:
                return UNRESOLVED, t, 1 + steps // STEPS, gap
        if is_leaf:
            leaf_a, leaf_b = root_a - int(child_a), root_b - int(child_b)
            d, triangles = leaf_time(
                blocks, int(place_a), leaf_a, blocks, int(place_b), leaf_b, X, move, gap,
                keep * size / speed, triangles, work,
            )  # fmt: skip
            if now < t and not now + d > t:  # looked at too early: again at its own time
                waiting, now = push_pair(work, waiting, t, place_a, place_b, float(triangles)), -inf
                continue
            if is_early and now + d <= t:
                return UNRESOLVED, t, 1 + steps // STEPS, gap
            if d == 0.0:
                answer[PLACE_A] = WIDTH * leaf_a + triangles // WIDTH
                answer[PLACE_B] = WIDTH * leaf_b + triangles % WIDTH
                return HIT, t, 1 + steps // STEPS, 0.0
            if now + d <= t:  # the time has no finer resolution
                return UNRESOLVED, t, 1 + steps // STEPS, 0.0
            if now + d < end:
                waiting = push_pair(work, waiting, now + d, place_a, place_b, float(triangles))
            continue
        in_b, block, size, soon = open_box(blocks, (root_a, a, i, child_a), (root_b, b, j, child_b), X, move, work)
        if soon * speed > keep * size and now + soon > t:  # else the time has no finer resolution
            if now + soon < end:
                waiting = push_pair(work, waiting, now + soon, place_a, place_b, -1.0)
            continue
        for k in range(WIDTH):
            time = max(t, now + work[BOUNDS + k])
            if blocks[block, CHILD, k] != 0.0 and time < later:
                child = float(WIDTH * block + k)
                if waiting < HEAP:
                    first, second = (place_a, child) if in_b else (child, place_b)
                    waiting = push_pair(work, waiting, time, first, second, -1.0)
                else:
                    later = time
                    if not later > start:
                        return UNRESOLVED, start, 1 + steps // STEPS, 0.0
