"""First impact of two moving meshes, or of a mesh and another shape with a tree, in one call of a kernel."""

from __future__ import annotations

import threading
from math import inf
from typing import Final

import numpy as np

from collision_monitor._jit import kernel
from collision_monitor.geometry.bounded_cache import bounded_cache
from collision_monitor.geometry.forest import Forest
from collision_monitor.geometry.pose import Motion
from collision_monitor.geometry.shape_table import TREE, ShapeTable, ShapeTableBuilder
from collision_monitor.geometry.shapes import Shape
from collision_monitor.meshes.inside import OUTSIDE, is_in
from collision_monitor.meshes.placing import inverse, relative
from collision_monitor.meshes.shape_trees import shape_tree, trees_of_pair
from collision_monitor.prediction.bodies import Multibody
from collision_monitor.prediction.body_impact import ImpactQuery, Window, body_impact
from collision_monitor.prediction.impact_record import CLEAR, HIT
from collision_monitor.query.packed import packed_motion
from collision_monitor.query.pair_impact_rows import DECIDED, TOUCHING, ImpactMemory, impact_memory, set_motion

REMEMBERED: Final = 256 << 20
"""Bytes of the tables of pairs that are remembered. Less: each query of two meshes copies their trees, 1 ms for
5,000 triangles."""


class _Memory(threading.local):
    """Work memory of each thread."""

    def __init__(self) -> None:
        self.impact: ImpactMemory = impact_memory()


_MEMORY: Final = _Memory()


def mesh_impact(
    shape_a: Shape, motion_a: Motion, shape_b: Shape, motion_b: Motion, query: tuple[float, float, float, int]
) -> tuple[float, float] | None:
    """First impact of two moving shapes: lower and upper (s), infinite for none; of an open mesh its surface.

    query: horizon (s), tolerance (m), separation (m), iterations. None for a pair without trees or without a mesh, and
    for shapes that touch at the start, which have to be followed (touching.py).
    """
    trees = trees_of_pair(shape_a, shape_b, surface=True)
    if trees is None:
        return None
    try:
        states = motion_a.packed_motion, motion_b.packed_motion  # type: ignore[attr-defined]
    except AttributeError:
        states = packed_motion(motion_a), packed_motion(motion_b)
        if states[0] is None or states[1] is None:
            return None
    times = np.empty(2)
    code = _mesh_impact(_table(shape_a, shape_b), *states, np.array(query), _MEMORY.impact, times)
    return None if code == TOUCHING else (float(times[0]), float(times[1]))


def _bytes(table: ShapeTable, *shapes: Shape) -> int:
    return int(table.blocks.nbytes)


@bounded_cache(REMEMBERED, _bytes)
def _table(a: Shape, b: Shape) -> ShapeTable:
    """Both shapes with their trees, in slots 0 and 1."""
    trees = [tree for tree in (shape_tree(a), shape_tree(b)) if tree is not None]
    builder = ShapeTableBuilder(slots=2, forest=Forest(sum(map(len, {id(tree): tree for tree in trees}.values()))))
    for shape, tree in zip((a, b), trees, strict=True):
        builder.append(shape, tree=tree)
    return builder.table


@kernel
def _mesh_impact(table, state_a, state_b, query, own, times):
    """Write the first impact to times (2,): lower and upper (s), infinite for none; return a code of its row.

    states (1, 16): packed motions. query (4,): horizon (s), tolerance (m), separation (m) and iterations.
    """
    bodies, parts, scratch, event, _ = own
    horizon = query[0]
    times[0] = times[1] = inf
    set_motion(bodies, 0, state_a, 0, table, horizon)
    set_motion(bodies, 1, state_b, 0, table, horizon)
    A, B, work = bodies.motion[0], bodies.motion[1], scratch.tree
    p = B.x - A.x, B.y - A.y, B.z - A.z
    reach = table.radius[0] + table.radius[1]
    if p[0] * p[0] + p[1] * p[1] + p[2] * p[2] <= reach * reach:  # else neither is in the other
        X = relative(A.rotation, B.rotation, p)
        first, second = int(table.size[0, TREE]) - 1, int(table.size[1, TREE]) - 1
        if (
            is_in(table.blocks, first, table.blocks, second, X, 0.0, work) != OUTSIDE
            or is_in(table.blocks, second, table.blocks, first, inverse(X), 0.0, work) != OUTSIDE
        ):
            return TOUCHING
    search = ImpactQuery(query[2], query[1], int(query[3]))
    body_impact(Multibody(table, parts, bodies), 0, 1, Window(0.0, horizon), search, scratch, event[0])
    if event[0].status == CLEAR:
        return DECIDED
    times[0] = event[0].lower
    if event[0].status == HIT and event[0].upper <= horizon:
        times[1] = event[0].upper
    return DECIDED if event[0].lower > 0.0 else TOUCHING
