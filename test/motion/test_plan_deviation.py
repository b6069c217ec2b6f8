"""States within and outside of the tolerance of a plan, beside the monitor's own judgement."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from collision_monitor import Monitor, Sphere, records
from collision_monitor.motion.plan_deviation import is_off_plan
from collision_monitor.motion.trajectory import Tolerance, Trajectory
from collision_monitor.shapes.pose import from_rotation_vector

TOLERANCE = Tolerance(0.3, 0.4, 0.5, 0.2)


def bent(rng: np.random.Generator) -> Trajectory:
    poses = np.zeros((4, 7))
    poses[:, :3] = rng.normal(0, 1, (4, 3))
    poses[:, 3:] = [from_rotation_vector(rng.normal(0, 0.5, 3)) for _ in range(4)]
    if rng.random() < 0.3:
        poses[2] = poses[1]
    return Trajectory([0.0, 1.0, 2.0, 3.0], poses, between="arc")


@given(st.integers(0, 100_000))
@settings(max_examples=150, deadline=None)
def test_the_monitor_drops_exactly_the_plans_of_states_outside(seed: int) -> None:
    rng = np.random.default_rng(seed)
    path, time = bent(rng), rng.uniform(0.1, 2.9)
    rows = np.zeros(1, records.STATE)
    rows["id"], planned = 1, path.rows(np.array([time]))[0]
    rows["position"] = planned[:3] + rng.normal(0, 0.25, 3)
    turn = from_rotation_vector(rng.normal(0, 0.2, 3))
    pose = path.at(time)
    x, y, z, w = pose.quaternion
    a, b, c, d = turn
    rows["quaternion"] = (
        d * x + a * w + b * z - c * y, d * y - a * z + b * w + c * x, d * z + a * y - b * x + c * w,
        d * w - a * x - b * y - c * z,
    )  # fmt: skip
    monitor = Monitor()
    monitor.add(1, Sphere(0.1))
    monitor.follow(1, path, tolerance=TOLERANCE, stamp_ns=0)
    rows_0 = np.zeros(1, records.STATE)
    rows_0["id"], rows_0["position"], rows_0["quaternion"] = 1, path.poses[0, :3], path.poses[0, 3:]
    monitor.step(0, rows_0)
    stamp = round(time * 1e9)
    left = monitor.step(stamp, rows).left == (1,)
    (expected,) = is_off_plan(path, TOLERANCE, np.array([stamp * 1e-9]), rows)
    assert left == expected


@pytest.mark.parametrize(("y", "expected"), [(0.29, False), (0.31, True)])
def test_the_tolerance_across_is_that_of_the_closed_form(y: float, expected: bool) -> None:
    rows = np.zeros(1, records.STATE)
    rows["position"], rows["quaternion"] = (0.5, y, 0), (0, 0, 0, 1)
    path = Trajectory([0, 1], [(0, 0, 0), (1, 0, 0)])
    assert is_off_plan(path, TOLERANCE, np.array([0.5]), rows).tolist() == [expected]
