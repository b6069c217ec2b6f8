"""Shapes that move, and dense samples that tell whether intervals of contact are right."""

from __future__ import annotations

from itertools import pairwise
from math import inf
from typing import Any

import numpy as np

import collision_monitor as cm

SHAPES: dict[str, Any] = {
    "box": cm.Box((0.9, 0.5, 0.4)),
    "capsule": cm.Capsule(0.15, 0.8),
    "hull": cm.ConvexHull(np.random.default_rng(3).normal(size=(14, 3)) * 0.3),
    "compound": [(cm.Box((0.8, 0.2, 0.2)), cm.Pose((0.3, 0, 0))), (cm.Sphere(0.2), cm.Pose((-0.4, 0.3, 0.1)))],
    "mesh": cm.Mesh(
        np.array([(-1, -1, -1), (1, -1, -1), (1, 1, -1), (-1, 1, -1), (0, 0, 1)], float) * 0.4,
        np.array([(0, 2, 1), (0, 3, 2), (0, 1, 4), (1, 2, 4), (2, 3, 4), (3, 0, 4)]),
    ),
}


def check_intervals(
    found: list[cm.ContactInterval], a: Any, one: Any, b: Any, other: Any, horizon: float, samples: int
) -> None:
    """Assert that shapes a and b, in the motions `one` and `other`, are in contact in these intervals alone."""
    ends = [time for each in found for time in (*each.entry, *each.exit)]
    assert all(before <= after for before, after in pairwise(ends))
    for t in np.linspace(0.0, horizon, samples):
        gap = cm.contact(a, one.at(t), b, other.at(t))
        inside = any(each.entry[1] <= t <= each.exit[0] for each in found)
        near = any(each.entry[0] <= t < each.entry[1] or each.exit[0] < t <= each.exit[1] for each in found)
        if inside:
            assert gap.signed_distance < 1e-5
        elif not near:
            assert gap.signed_distance > -gap.error_bound - 1e-9
    for each in found:
        assert each.entry[1] < inf
        assert each.exit[1] == inf or each.exit[1] - each.exit[0] < 0.02
