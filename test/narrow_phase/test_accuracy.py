"""Tests that a separation which need not be exact is as good as it has to be."""

from __future__ import annotations

import numpy as np
import pytest

from collision_monitor.narrow_phase.dispatch import separation
from collision_monitor.narrow_phase.gjk import EXACT, Accuracy
from collision_monitor.narrow_phase.pair_pose import PairPose
from collision_monitor.narrow_phase.work_memory import work_array
from collision_monitor.shapes.pose import rotation_matrix
from collision_monitor.shapes.registry import Box, Capsule, Cylinder, Shape
from collision_monitor.shapes.shape_table import ShapeTableBuilder

NEAR, SLACK = 0.05, 0.01


@pytest.mark.parametrize("other", [Cylinder(0.2, 0.5), Box((0.2, 0.3, 0.4)), Capsule(0.1, 0.4)])
def test_a_rough_separation_is_too_small_by_at_most_the_slack(other: Shape) -> None:
    builder, random = ShapeTableBuilder(), np.random.default_rng(0)
    a, b = builder.append(Cylinder(0.3, 0.4)), builder.append(other)
    out, work, decided = np.zeros(16), work_array(), [0, 0]
    for _ in range(300):
        turned = [rotation_matrix(q / np.linalg.norm(q)) for q in random.normal(size=(2, 4))]
        pose = PairPose(*turned, tuple(random.normal(size=3) * 0.4))
        exact = separation(builder.table, a, b, pose, out, work, EXACT)
        rough = separation(builder.table, a, b, pose, out, work, Accuracy(NEAR, SLACK))
        decided[exact > NEAR] += 1
        assert rough <= exact + 1e-12
        assert rough >= exact - SLACK - 1e-12 if exact > NEAR else rough <= NEAR
    assert min(decided) > 30
