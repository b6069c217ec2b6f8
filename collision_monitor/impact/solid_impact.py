"""First impact of a moving tree and a moving solid, by conservative advancement of each box for itself.

As in tree_impact.py, boxes wait in the order of the times until which they certainly stay apart from the solid.
"""

from __future__ import annotations

from math import inf, sqrt
from typing import Any, Final

from collision_monitor._jit import inlined, outlined
from collision_monitor.geometry.vector import dot
from collision_monitor.impact.impact_record import CLEAR, HIT, UNRESOLVED
from collision_monitor.impact.mesh_pair import root_of
from collision_monitor.impact.tree_impact import (
    HEAP,
    KEEP,
    KEEP_EARLY,
    STEPS,
    box_radius,
    ending_gap,
    pop_first,
    push_pair,
    steps_of,
    times_of,
    tree_approach_at,
)
from collision_monitor.meshes.distance.contact import reach_in
from collision_monitor.meshes.distance.nearest import BOUNDS, PAIRS, size_of
from collision_monitor.meshes.distance.solid import MovingSolid, SolidMemory, box_time, center_of, leaf_solid_time
from collision_monitor.meshes.layout import CHILD, WIDTH
from collision_monitor.meshes.placing import inverse, place_point, relative
from collision_monitor.narrow_phase.core import core_length
from collision_monitor.narrow_phase.pair_pose import PairPose
from collision_monitor.shapes.calls import point_distance_range
from collision_monitor.shapes.kinds.half_space import HALF_SPACE

EXAMINED: Final = 30
"""Steps that a triangle counts as, of the STEPS: GJK takes as long as 30 boxes. 50,000 slivers in one line need more
than any limit."""


@inlined
def _farthest(blocks: Any, block: int, k: int, solid: MovingSolid) -> float:
    """Bound on the distance of the solid from the farthest point of a box (m)."""
    center = place_point(inverse(solid.X), center_of(blocks, block, k))
    return point_distance_range(solid.table, solid.b, center)[1] + box_radius(blocks, block, k)


@inlined
def _times_of_members(blocks: Any, block: int, solid: MovingSolid, work: Any) -> float:
    """Write to work[BOUNDS:] until when the boxes of a block stay apart from the solid (s); return the least."""
    soon = inf
    for m in range(WIDTH):
        if blocks[block, CHILD, m] != 0.0:
            work[BOUNDS + m] = box_time(blocks, block, m, solid)
            soon = min(soon, work[BOUNDS + m])
    return soon


@outlined
def solid_impact(
    table: Any, parts: Any, pair: Any, window: Any, tube: Any, query: Any, ending: Any, scratch: Any
) -> tuple[int, float, int, float]:
    """`tree_impact` of a tree and a solid, which may not be swapped: pair has both motions, then both slots."""
    A, B, a, b = pair
    begin, end = times_of(window)
    blocks, work, root = table.blocks, scratch.tree, root_of(table, a)
    memory = SolidMemory(scratch.triangle, scratch.work, work)
    own = 0.0 if table.kind[b] == HALF_SPACE else core_length(table, b)
    start, later, steps, most = begin, end, 0, steps_of(A, B, end - begin, query, ending)
    is_early, gap = ending.tolerance > 0.0, query.tolerance
    keep = KEEP_EARLY if is_early else KEEP
    waiting = push_pair(work, 0, begin, float(WIDTH * root), 0.0, 0.0)
    while True:
        if waiting == 0 or work[PAIRS] >= later:
            if not later < end:
                return CLEAR, end, 1 + steps // STEPS, 0.0
            start, later, waiting = later, end, push_pair(work, 0, later, float(WIDTH * root), 0.0, 0.0)
        t, place = work[PAIRS], work[PAIRS + 1]
        waiting = pop_first(work, waiting)
        steps += 1
        if steps > most:
            return UNRESOLVED, t, 1 + steps // STEPS, gap
        margin = query.margin + tube.start + tube.growth * (t - begin)
        p, move = tree_approach_at(table, parts, pair, t, margin, tube.growth, end, scratch)
        R_a, R_b = scratch.rotation[2], scratch.rotation[3]
        X = relative(R_a, R_b, p)
        solid = MovingSolid(table, b, PairPose(R_a, R_b, p), X, move)
        i, k = int(place) // WIDTH, int(place) % WIDTH
        child = blocks[i, CHILD, k]
        block = root + int(abs(child))
        speed = sqrt(dot(move.v, move.v)) + move.growth
        speed += sqrt(move.bend_a) * reach_in(blocks, root) + sqrt(move.bend_b) * own
        if is_early:
            gap = ending_gap(ending, speed, t, query)
            if _farthest(blocks, i, k, solid) <= gap + move.start:
                return UNRESOLVED, t, 1 + steps // STEPS, gap
        if child < 0.0:
            enough = (keep * size_of(blocks, i, k) + gap) / speed  # points have no size
            soon, examined = leaf_solid_time(blocks, block, solid, gap, enough, memory)
            if not is_early:
                steps += EXAMINED * examined
            if t + soon <= t:  # or the time has no finer resolution
                status = HIT if soon == 0.0 and not is_early else UNRESOLVED
                return status, t, 1 + steps // STEPS, gap if is_early else 0.0
        else:
            soon = _times_of_members(blocks, block, solid, work)
        if child < 0.0 or (soon * speed > keep * size_of(blocks, i, k) and t + soon > t):
            if t + soon < end:
                waiting = push_pair(work, waiting, t + soon, place, 0.0, 0.0)
            continue
        for m in range(WIDTH):
            time = t + work[BOUNDS + m]
            if blocks[block, CHILD, m] != 0.0 and time < later:
                if waiting < HEAP:
                    waiting = push_pair(work, waiting, time, float(WIDTH * block + m), 0.0, 0.0)
                else:
                    later = time
                    if not later > start:
                        return UNRESOLVED, start, 1 + steps // STEPS, 0.0
