"""Probabilities of impact of bodies that follow plans, against plans that random errors move, one by one."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import collision_monitor as cm
from collision_monitor.records import STATE

HORIZON = 2.4
FUTURES = 400
TIMES = np.array([0.0, 0.8, 1.6, 2.4])


def path(rng: np.random.Generator) -> np.ndarray:
    """Poses (4, 7) of a robot that bends twice."""
    poses = np.zeros((4, 7))
    yaw = np.cumsum(np.append(0.0, rng.uniform(-0.6, 0.6, 3)))
    heading = yaw[:-1] + 0.5 * np.diff(yaw)
    poses[1:, 0], poses[1:, 1] = np.cumsum(0.8 * np.cos(heading)), np.cumsum(0.8 * np.sin(heading))
    poses[:, 3:] = Rotation.from_rotvec(np.outer(yaw, (0.0, 0.0, 1.0))).as_quat()
    return poses


def answer(monitor: cm.Monitor, rows: Any) -> Any:
    """The only prediction, or None; None if the bodies touch too."""
    result = monitor.step(0, rows)
    assert len(result.predictions) <= 1
    return None if len(result.contacts) else result.predictions


@pytest.mark.parametrize(("between", "turned", "seed"), [("straight", 0.08, 1), ("arc", 0.0, 2)])
def test_probabilities_are_shares_of_plans_that_errors_move(between: Any, turned: float, seed: int) -> None:
    rng = np.random.default_rng(seed)
    obstacles = [cm.Box((0.4, 0.5, 0.5)), cm.Sphere(0.3), cm.Cylinder(0.2, 0.5)]
    errors: list[float] = []
    while len(errors) < 10:
        poses, robot, obstacle = path(rng), cm.Box((0.6, 0.4, 0.5)), obstacles[rng.integers(3)]
        velocity, when = np.append(rng.uniform(-0.5, 0.5, 2), 0.0), rng.uniform(0.8, 2.0)
        at = poses[rng.integers(1, 4), :3] - when * velocity + np.append(rng.normal(0.0, 0.45, 2), 0.0)
        plan = cm.Trajectory(TIMES, poses, between=between)
        monitor = cm.Monitor(cm.Profile(horizon=HORIZON, min_probability=0.005))
        ids = (1, 2) if rng.random() < 0.5 else (2, 1)
        monitor.add(ids[0], robot)
        monitor.add(ids[1], obstacle)
        monitor.follow(ids[0], plan, stamp_ns=0)
        rows = np.zeros(2, STATE)
        rows["id"], rows["quaternion"][:, 3] = ids, 1.0
        rows["position"][1], rows["linear"][1] = at, velocity
        stddevs = rng.uniform(0.02, 0.15), rng.uniform(0.0, 0.1), rng.uniform(0.0, 0.1)
        rows["position_stddev"], rows["velocity_stddev"] = stddevs[:2], (0.2, stddevs[2])  # 0.2 m/s: of the robot
        rows["orientation_stddev"][0] = turned
        found = answer(monitor, rows)
        if found is None:
            continue
        times = np.full(FUTURES, np.inf)
        for n in range(FUTURES):
            moved, turn = poses.copy(), Rotation.from_rotvec(rng.normal(0.0, turned, 3))
            moved[:, :3] += rng.normal(0.0, stddevs[0], 3)
            moved[:, 3:] = (turn * Rotation.from_quat(poses[:, 3:])).as_quat()
            start = cm.Pose(tuple(at + rng.normal(0.0, stddevs[1], 3)))
            other = cm.Motion(start, tuple(velocity + rng.normal(0.0, stddevs[2], 3)))
            true = cm.Trajectory(TIMES, moved, between=between)
            impact = cm.time_of_impact(robot, true, obstacle, other, HORIZON)
            if impact.status != "clear":
                times[n] = impact.lower
        share = np.isfinite(times).mean()
        errors.append((float(found["probability"][0]) if len(found) else 0.0) - share)
        if len(found) and share > 0.1:
            inside = (times >= found["earliest"][0]) & (times <= found["latest"][0])
            assert inside[np.isfinite(times)].mean() > 0.9
    # 400 futures alone are off by 0.025, and by 0.075 at most
    assert np.max(np.abs(errors)) < 0.1
    assert np.sqrt(np.mean(np.square(errors))) < 0.035


def test_errors_of_the_velocity_do_not_move_a_body_off_its_plan() -> None:
    """A robot beside a wall 0.3 m away: 0.2 m/s of error reach the wall in the horizon, but not along the plan."""
    poses = [(0.0, 0.0, 0.0), (2.0, 0.0, 0.0)]
    found = []
    for follows in (False, True):
        monitor = cm.Monitor(cm.Profile(horizon=2.0))
        monitor.add(1, cm.Box((0.5, 0.5, 0.5)))
        monitor.add(2, cm.Box((4.0, 0.1, 1.0)), static=True, pose=cm.Pose((1.0, 0.6, 0.0)))
        if follows:
            monitor.follow(1, cm.Trajectory([0.0, 2.0], poses), stamp_ns=0)
        rows = np.zeros(1, STATE)
        rows["id"], rows["quaternion"][:, 3], rows["linear"][:, 0] = 1, 1.0, 1.0
        rows["position_stddev"], rows["velocity_stddev"] = 0.02, 0.2
        predictions = monitor.step(0, rows).predictions
        found.append(float(predictions["probability"][0]) if len(predictions) else 0.0)
    assert found[0] > 0.1
    assert found[1] == 0.0


def test_a_plan_past_a_wall_is_reported_with_the_errors_of_its_position() -> None:
    """Beside it by 0.1 m with 0.05 m of error: it meets the wall with the probability of two standard deviations."""
    monitor = cm.Monitor(cm.Profile(horizon=2.0))
    monitor.add(1, cm.Box((0.5, 0.5, 0.5)))
    monitor.add(2, cm.Box((4.0, 0.1, 1.0)), static=True, pose=cm.Pose((3.5, 0.4, 0.0)))
    monitor.follow(1, cm.Trajectory([0.0, 2.0], [(0.0, 0.0, 0.0), (3.0, 0.0, 0.0)]), stamp_ns=0)
    rows = np.zeros(1, STATE)
    rows["id"], rows["quaternion"][:, 3], rows["position_stddev"] = 1, 1.0, 0.05
    predictions = monitor.step(0, rows).predictions
    assert predictions["probability"] == pytest.approx([0.0228], abs=0.005)
    assert 0.6 < predictions["earliest"][0] < 1.25 / 1.5 < predictions["latest"][0]  # the wall begins at x = 1.5
