"""First impact of two moving meshes, or of a mesh and another shape with a tree, in one call of a kernel."""

from __future__ import annotations

from math import inf

from collision_monitor._jit import kernel
from collision_monitor._jit.direct import direct
from collision_monitor.geometry.pose import Motion
from collision_monitor.geometry.shapes import Shape
from collision_monitor.meshes.shape_trees import trees_of_pair
from collision_monitor.prediction.bodies import Multibody
from collision_monitor.prediction.body_impact import ImpactQuery, Window, body_impact
from collision_monitor.prediction.impact_record import CLEAR, HIT
from collision_monitor.query.convex_pairs import MEMORY
from collision_monitor.query.packed import packed_motion
from collision_monitor.query.pair_impact_rows import set_motion
from collision_monitor.query.pair_table import pair_table


def mesh_impact(
    shape_a: Shape,
    motion_a: Motion,
    shape_b: Shape,
    motion_b: Motion,
    query: tuple[float, float, float, int],
    begin: float = 0.0,
) -> tuple[float, float] | None:
    """First impact of two moving shapes: lower and upper (s), infinite for none; of an open mesh its surface.

    query: horizon (s), tolerance (m), separation (m), iterations. begin: time (s) before which there is none.
    None for a pair without trees or without a mesh, and for shapes that touch at the start, which have to be followed
    (touching.py).
    """
    if trees_of_pair(shape_a, shape_b, surface=True) is None:
        return None
    try:
        states = motion_a.packed_motion, motion_b.packed_motion  # type: ignore[attr-defined]
    except AttributeError:
        states = packed_motion(motion_a), packed_motion(motion_b)
        if states[0] is None or states[1] is None:
            return None
    return _mesh_impact(pair_table(shape_a, shape_b, True), *states, *query, begin, MEMORY.impact)


@direct
@kernel
def _mesh_impact(table, state_a, state_b, horizon, tolerance, separation, iterations, begin, own):
    """First impact: lower and upper (s), infinite for none; None for shapes that touch at the start.

    states (1, 16): packed motions. begin: time at which the search begins (s). own: ImpactMemory.
    """
    bodies, parts, scratch, event, _ = own
    set_motion(bodies, 0, state_a, 0, table, horizon)
    set_motion(bodies, 1, state_b, 0, table, horizon)
    search = ImpactQuery(separation, tolerance, iterations)
    body_impact(Multibody(table, parts, bodies), 0, 1, Window(begin, horizon), search, scratch, event[0])
    if event[0].status == CLEAR:
        return inf, inf
    if not event[0].lower > 0.0:
        return None
    return event[0].lower, event[0].upper if event[0].status == HIT and event[0].upper <= horizon else inf
