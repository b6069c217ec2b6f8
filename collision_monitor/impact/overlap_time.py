"""A time at which two moving meshes certainly overlap although their triangles only touch, in one plane."""

from __future__ import annotations

from math import inf, sqrt
from typing import Any, Final

from collision_monitor._jit import inlined, outlined
from collision_monitor.geometry.vector import dot, sum_of_sizes
from collision_monitor.impact.mesh_pair import has_mesh, have_trees, root_of
from collision_monitor.impact.tree_impact import tree_approach_at
from collision_monitor.meshes.advance.approach import time_until
from collision_monitor.meshes.distance.contact import reach_in
from collision_monitor.meshes.overlap.common_point import bounds_solid, common_ball
from collision_monitor.meshes.placing import relative
from collision_monitor.tolerances import GJK_TOUCHING, SAT_ROUND_OFF

MOST_TIMES: Final = 5
"""Most times to try: the begin, and others from the one at which the meshes may be two tolerances deep. More: solids
that slide with faces in one plane take longer. Fewer: impacts of surfaces that close slowly stay UNRESOLVED; those of
solids that slide first, and overlap later, stay so anyway."""

LATER: Final = 4.0
"""Ratio of a time after the start to the one before. Larger: the interval of an oblique impact is wider. Smaller: more
times."""

LATE: Final = 64.0
"""A known time is late if the meshes may be two tolerances deep in a 64th of it. Larger: it is sought less often.
Smaller: it is sought for meshes that graze each other too, whose time is late because they close slowly."""


@inlined
def _wanted(table: Any, pair: Any, t: float, window: Any, tube: Any, query: Any) -> float:
    """Depth (m) beyond which nothing that is uncertain at t parts two solids, apart from round-off."""
    known = query.margin + table.margin[pair.a] + table.margin[pair.b]
    return max(tube.start + tube.growth * (t - window.begin) - known, 0.0)


@outlined
def overlap_time(
    table: Any, parts: Any, pair: Any, known: Any, window: Any, tube: Any, query: Any, scratch: Any
) -> float:
    """Return a time in the window (s) at which both solids certainly contain a common ball, or the one that is known.

    known: the times from which on they may touch, and from which on they certainly overlap, infinite for none. If the
    second one is late, an earlier one is sought. pair (ShapePair), tube, query: as for `shape_impact`. A translation
    that parts the solids is longer than the ball's diameter, which exceeds the tube and what counts as touching
    (tolerances.py). The tube's time begins with the window.
    """
    start, sure = known
    a, b = pair.a, pair.b
    if not (has_mesh(table, a, b) and have_trees(table, a, b)):
        return sure
    blocks, root_a, root_b = table.blocks, root_of(table, a), root_of(table, b)
    if not (bounds_solid(blocks, root_a) and bounds_solid(blocks, root_b)):
        return sure
    end = min(window.end, sure)
    p, move = tree_approach_at(table, parts, pair, start, 0.0, 0.0, end, scratch)
    reach_a, reach_b = reach_in(blocks, root_a), reach_in(blocks, root_b)
    speed = sqrt(dot(move.v, move.v)) + sqrt(move.bend_a) * reach_a + sqrt(move.bend_b) * reach_b
    bend = move.bend + move.bend_a * reach_a + move.bend_b * reach_b
    slack = GJK_TOUCHING * (table.radius[a] + table.radius[b])
    part = slack + SAT_ROUND_OFF * sum_of_sizes(p)
    soon = time_until(2.0 * (query.tolerance + _wanted(table, pair, start, window, tube, query) + part), speed, bend)
    if sure < inf and sure - start <= LATE * soon:
        return sure
    elapsed = 0.0 if start <= window.begin else soon  # after the begin they only start to overlap
    for _ in range(MOST_TIMES):
        t = min(start + elapsed, end)
        if not (elapsed < inf and t < sure):
            break
        p, _ = tree_approach_at(table, parts, pair, t, 0.0, 0.0, end, scratch)
        X = relative(scratch.rotation[2], scratch.rotation[3], p)
        radius = 0.5 * (_wanted(table, pair, t, window, tube, query) + part)
        moved = speed * elapsed + 0.5 * bend * elapsed * elapsed if elapsed > 0.0 else inf
        if common_ball(blocks, root_a, root_b, X, radius, slack, moved, scratch.tree):
            return t
        if not t < end:
            break
        elapsed = soon if elapsed == 0.0 else LATER * elapsed
    return sure
