"""First impact of two moving meshes, or of a mesh and another shape with a tree, in one call of a kernel."""

from __future__ import annotations

from math import inf

import numpy as np

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
from collision_monitor.query.pair_impact_rows import DECIDED, TOUCHING, set_motion
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
    times = np.empty(2)
    code = _mesh_impact(pair_table(shape_a, shape_b, True), *states, np.array((*query, begin)), MEMORY.impact, times)
    return None if code == TOUCHING else (float(times[0]), float(times[1]))


@direct
@kernel
def _mesh_impact(table, state_a, state_b, query, own, times):
    """Write the first impact to times (2,): lower and upper (s), infinite for none; return a code of its row.

    states (1, 16): packed motions. query (5,): horizon (s), tolerance (m), separation (m),
    iterations, and the time at which the search begins (s).
    """
    bodies, parts, scratch, event, _ = own
    horizon = query[0]
    times[0] = times[1] = inf
    set_motion(bodies, 0, state_a, 0, table, horizon)
    set_motion(bodies, 1, state_b, 0, table, horizon)
    search = ImpactQuery(query[2], query[1], int(query[3]))
    body_impact(Multibody(table, parts, bodies), 0, 1, Window(query[4], horizon), search, scratch, event[0])
    if event[0].status == CLEAR:
        return DECIDED
    times[0] = event[0].lower
    if event[0].status == HIT and event[0].upper <= horizon:
        times[1] = event[0].upper
    return DECIDED if event[0].lower > 0.0 else TOUCHING
