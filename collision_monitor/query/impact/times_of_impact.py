"""`times_of_impact`: `time_of_impact` for arrays of pairs."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from collision_monitor.checks.numbers import checked_rows
from collision_monitor.errors import PoseError
from collision_monitor.query.batch_result import Pairs
from collision_monitor.query.contact.convex_pairs import MEMORY
from collision_monitor.query.impact.moving_pair import ITERATIONS
from collision_monitor.query.impact.pair_impact_rows import DECIDED, pair_impact_rows
from collision_monitor.query.impact.time_of_impact import check_query, time_of_impact
from collision_monitor.query.impact.time_of_impact_batch import Impacts, motion_of
from collision_monitor.query.pair_arrays import (
    Progress,
    Shapes,
    pack_shapes,
    pair_count,
    pair_ranges,
    part,
    pose_rows,
)
from collision_monitor.tolerances import LARGEST_INPUT


def times_of_impact(
    shapes_a: Shapes,
    poses_a: Any,
    twists_a: ArrayLike,
    shapes_b: Shapes,
    poses_b: Any,
    twists_b: ArrayLike,
    horizon: float = 2.0,
    tolerance: float = 1e-6,
    separation: float = 0.0,
    iterations: int = ITERATIONS,
    progress: Progress | None = None,
) -> Impacts:
    """`time_of_impact` for N pairs of moving shapes.

    shapes: one for all pairs, or a list of N; poses: (N, 7) x y z qx qy qz qw (m), a list of N Pose, or one for all;
    twists: (N, 6) vx vy vz wx wy wz (m/s, rad/s), or one for all. progress: called with the number of pairs that are
    done. Convex solids take 0.3 to 5 µs a pair; other shapes, and those that touch at the start, 0.1 to 1 ms.
    `time_of_impact_batch` is faster for one pair of spheres in many motions. Raises as `time_of_impact` does, and
    InputError if the lengths differ.

    >>> import collision_monitor as cm
    >>> poses = [(x, 0, 0, 0, 0, 0, 1) for x in (2, 2.5, 9)]
    >>> still, towards = (0, 0, 0, 0, 0, 0), (-1, 0, 0, 0, 0, 0)
    >>> cm.times_of_impact(cm.Box((1, 1, 1)), cm.Pose(), still, cm.Sphere(0.5), poses, towards).status
    array(['hit', 'hit', 'clear'], dtype='<U10')
    """
    query = check_query(horizon, tolerance, separation, iterations)
    a, b = pack_shapes(shapes_a, "shapes A"), pack_shapes(shapes_b, "shapes B")
    states = []
    for poses, twists, name in ((poses_a, twists_a, "A"), (poses_b, twists_b, "B")):
        x, v = pose_rows(poses, f"poses {name}"), checked_rows(twists, 6, f"twists {name}", LARGEST_INPUT, PoseError)
        state = np.zeros((pair_count(poses=len(x), twists=len(v)), 16))
        state[:, :7], state[:, 7:13] = x, v
        states.append(state)
    s_a, s_b = states
    count = pair_count(shapes_a=len(a), motions_a=len(s_a), shapes_b=len(b), motions_b=len(s_b))
    special = np.broadcast_to((a.at < 0) | (b.at < 0), (count,))
    at_a, at_b = np.maximum(a.at, 0), np.maximum(b.at, 0)
    memory, wanted = MEMORY.enlarge(a.rows, b.rows), np.array(query, dtype=np.float64)
    rows = np.full((count, 3), math.inf)
    for which in pair_ranges(count, progress):
        if not special[which].all():
            pair_impact_rows(
                a.rows, part(at_a, which), part(s_a, which), b.rows, part(at_b, which), part(s_b, which),
                wanted, MEMORY.impact, memory, rows[which],
            )  # fmt: skip
        for k in (which.start + np.flatnonzero(special[which] | (rows[which, 2] != DECIDED))).tolist():
            motions = [motion_of(s[k if len(s) > 1 else 0]) for s in states]
            one = time_of_impact(a.of(k), motions[0], b.of(k), motions[1], *query)
            rows[k, :2] = one.lower, one.upper
    lower, upper, _ = rows.T
    status = np.where(lower == math.inf, "clear", np.where(upper == math.inf, "unresolved", "hit"))
    is_single = special | (rows[:, 2] != DECIDED)
    return Impacts(status, lower.copy(), upper.copy(), Pairs(a, s_a, b, s_b), np.arange(count), is_single, query)
