"""First impact of two shapes, at least one a mesh or a cloud."""

from __future__ import annotations

from typing import Any

from collision_monitor._jit import device
from collision_monitor.impact.impact_record import CLEAR, HIT, UNRESOLVED
from collision_monitor.impact.mesh_pair import enclosure, have_trees, is_mesh
from collision_monitor.impact.solid_impact import solid_impact
from collision_monitor.impact.tree_impact import tree_approach_at, tree_impact
from collision_monitor.meshes.distance.nearest import PLACE_A
from collision_monitor.meshes.overlap.inside import INSIDE, OUTSIDE
from collision_monitor.narrow_phase.pair_pose import PairPose


@device
def mesh_impact(
    table: Any, parts: Any, pair: Any, window: Any, tube: Any, query: Any, ending: Any, scratch: Any
) -> tuple[int, float, int, float]:
    """`shape_impact` of a pair (ShapePair) with a mesh or a cloud; one that is in the other has its impact at once.

    ending: when the search ends early, see `tree_impact`.
    """
    if have_trees(table, pair.a, pair.b):
        status, t, queries, guess = tree_impact(table, parts, pair, window, tube, query, ending, scratch)
    elif is_mesh(table, pair.a):
        status, t, queries, guess = solid_impact(table, parts, pair, window, tube, query, ending, scratch)
    else:
        swapped = (pair.B, pair.A, pair.b, pair.a)
        status, t, queries, guess = solid_impact(table, parts, swapped, window, tube, query, ending, scratch)
    if t > window.begin or status == CLEAR:
        where = _enclosure_at(table, parts, pair, window.begin, scratch)
        if where != OUTSIDE:
            scratch.answer[PLACE_A] = -1.0  # no triangles meet
            return HIT if where == INSIDE else UNRESOLVED, window.begin, queries, 0.0
    return status, t, queries, guess


@device
def _enclosure_at(table: Any, parts: Any, pair: Any, t: float, scratch: Any) -> int:
    """`enclosure` of a pair at time t (s)."""
    p, _ = tree_approach_at(table, parts, pair, t, 0.0, 0.0, t, scratch)
    return enclosure(table, pair.a, pair.b, PairPose(scratch.rotation[2], scratch.rotation[3], p), scratch)
