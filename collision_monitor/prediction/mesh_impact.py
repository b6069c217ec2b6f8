"""First impact of two shapes, at least one a mesh or a cloud."""

from __future__ import annotations

from math import inf

from collision_monitor._jit import device
from collision_monitor.meshes.inside import INSIDE, OUTSIDE
from collision_monitor.meshes.nearest import PLACE_A
from collision_monitor.meshes.solid import SolidMemory, advance_to_solid
from collision_monitor.narrow_phase.pair_pose import PairPose
from collision_monitor.prediction.impact_record import CLEAR, HIT, UNRESOLVED
from collision_monitor.prediction.mesh_pair import enclosure, have_trees, is_mesh, root_of
from collision_monitor.prediction.tree_impact import approach_at, tree_impact


@device
def mesh_impact(table, parts, pair, window, tube, query, scratch):
    """`shape_impact` of a pair (ShapePair) with a mesh or a cloud; one that is in the other has its impact at once."""
    if have_trees(table, pair.a, pair.b):
        status, t, queries, guess = tree_impact(table, parts, pair, window, tube, query, scratch)
    elif is_mesh(table, pair.a):
        status, t, queries, guess = _solid_impact(table, parts, pair, window, tube, query, scratch)
    else:
        swapped = (pair.B, pair.A, pair.b, pair.a)
        status, t, queries, guess = _solid_impact(table, parts, swapped, window, tube, query, scratch)
    if t > window.begin or status == CLEAR:
        where = _enclosure_at(table, parts, pair, window.begin, scratch)
        if where != OUTSIDE:
            scratch.answer[PLACE_A] = -1.0  # no triangles meet
            return HIT if where == INSIDE else UNRESOLVED, window.begin, queries, 0.0
    return status, t, queries, guess


@device
def _enclosure_at(table, parts, pair, t, scratch):
    """`enclosure` of a pair at time t (s)."""
    p, _ = approach_at(table, parts, pair, t, 0.0, 0.0, t, scratch)
    return enclosure(table, pair.a, pair.b, PairPose(scratch.rotation[2], scratch.rotation[3], p), scratch)


@device
def _solid_impact(table, parts, pair, window, tube, query, scratch):
    """The same for a tree and a solid: each step advances all triangles and points of the tree."""
    a, b = pair[2], pair[3]
    begin, end = window
    memory = SolidMemory(scratch.triangle, scratch.work, scratch.tree)
    t = t_before = begin
    gap_before = inf
    for iteration in range(1, query.iterations + 1):
        margin = query.margin + tube.start + tube.growth * (t - begin)
        p, move = approach_at(table, parts, pair, t, margin, tube.growth, end, scratch)
        pose = PairPose(scratch.rotation[2], scratch.rotation[3], p)
        d, gap = advance_to_solid(
            table.blocks, root_of(table, a), table, b, pose, move, end - t, query.tolerance, memory
        )
        if d == 0.0:
            guess = 0.0
            if t > t_before and gap_before > gap:
                wanted = gap + query.tolerance + 2.0 * (margin - query.margin)
                guess = wanted * (t - t_before) / (gap_before - gap)
            return HIT, t, iteration, guess
        if d >= end - t:
            return CLEAR, end, iteration, 0.0
        t_before, gap_before = t, gap
        if t + d <= t:  # the time has no finer resolution
            return UNRESOLVED, t, iteration, 0.0
        t += d
    return UNRESOLVED, t, query.iterations, 0.0
