"""Paths without times: how fast, and from where."""

from __future__ import annotations

from math import inf, pi, sqrt
from typing import Any

import numpy as np
import pytest
from fed import Fed
from foreign_bag import SECOND, START, odometry
from foreign_plans import ROBOT, path
from hypothesis import given as examples
from hypothesis import settings
from hypothesis import strategies as st

from collision_monitor.codec.trajectories import ObjectTrajectory, Then
from collision_monitor.sources.plans.speed_profile import SpeedLimits, profile_times
from collision_monitor.sources.plans.timeless_path import TimelessPath

STILL = (0, 0, 0, 1)


def line(length: float, count: int = 2) -> Any:
    poses = np.zeros((count, 7))
    poses[:, 0], poses[:, 6] = np.linspace(0, length, count), 1.0
    return poses


@examples(
    length=st.floats(0.05, 50), speed=st.floats(0.1, 3), acceleration=st.floats(0.1, 3), part=st.floats(0, 1),
    stops=st.booleans(),
)  # fmt: skip
@settings(max_examples=200, deadline=None)
def test_a_straight_way_takes_the_time_of_the_textbook(
    length: float, speed: float, acceleration: float, part: float, stops: bool
) -> None:
    """The oracle is the trapezoid of the speed: accelerate, cruise, brake."""
    first = min(part * speed, sqrt(2 * acceleration * length))
    times, _, _ = TimelessPath(line(length), SpeedLimits(speed, acceleration), stops=stops).plan_from(0.0, first)
    most = acceleration * length + first**2 / 2 if stops else first**2 + 2 * acceleration * length
    top = min(speed, sqrt(most))
    last = 0.0 if stops else top
    ramps = (2 * top**2 - first**2 - last**2) / (2 * acceleration)
    expected = (2 * top - first - last) / acceleration + (length - ramps) / top
    assert times[-1] == pytest.approx(expected, rel=0.03, abs=0.05)
    assert (np.diff(times) > 0).all()


def test_limits_hold_between_all_points_and_the_profile_is_the_fastest_one() -> None:
    rng = np.random.default_rng(3)
    poses = np.zeros((60, 7))
    poses[:, :2], poses[:, 6] = np.cumsum(rng.normal(0.3, 0.2, (60, 2)), axis=0), 1.0
    limits = SpeedLimits(1.2, 0.6, 0.4)
    times, points, ways = TimelessPath(poses, limits, stops=True).plan_from(0.0, 0.0)
    speeds = np.diff(ways) / np.diff(times)
    assert speeds.max() <= 1.2 + 1e-9
    middle = (times[:-1] + times[1:]) / 2
    assert np.abs(np.diff(speeds) / np.diff(middle)).max() <= 0.6 * 1.05
    slower, _, _ = TimelessPath(poses, SpeedLimits(1.2, 0.6), stops=True).plan_from(0.0, 0.0)
    assert times[-1] > slower[-1]
    assert np.allclose(points[[0, -1]], poses[[0, -1]])


def test_the_speed_in_a_circle_is_that_of_its_lateral_acceleration() -> None:
    angle = np.linspace(0, 2 * pi, 400)
    position = np.column_stack([2 * np.cos(angle), 2 * np.sin(angle), 0 * angle])
    way = np.append(0, np.cumsum(np.linalg.norm(np.diff(position, axis=0), axis=1)))
    times = profile_times(way, position, SpeedLimits(5.0, inf, 0.5), 0.0, stops=True)
    inner = (way[1:] > 0.5) & (way[:-1] < way[-1] - 0.5)
    assert (np.diff(way) / np.diff(times))[inner] == pytest.approx(sqrt(0.5 * 2.0), rel=0.02)


def test_a_robot_that_is_too_fast_brakes_as_hard_as_it_may() -> None:
    times, _, ways = TimelessPath(line(10, 11), SpeedLimits(0.5, 1.0), stops=True).plan_from(0.0, 2.0)
    expected = (2 - np.sqrt(4 - 2 * np.minimum(ways, 1.8))) / 1.0  # until 0.5 m/s
    assert times[ways < 1.8] == pytest.approx(expected[ways < 1.8], abs=1e-6)


@examples(st.integers(0, 10_000))
@settings(max_examples=100, deadline=None)
def test_the_nearest_place_is_that_of_a_dense_search(seed: int) -> None:
    rng = np.random.default_rng(seed)
    poses = np.zeros((8, 7))
    poses[:, :3], poses[:, 6] = rng.normal(0, 2, (8, 3)), 1.0
    of = TimelessPath(poses, SpeedLimits(1.0), stops=True)
    dense = np.concatenate([np.linspace(a, b, 2000) for a, b in zip(poses[:-1, :3], poses[1:, :3], strict=True)])
    ways = np.append(0, np.cumsum(np.linalg.norm(np.diff(dense, axis=0), axis=1)))
    position = rng.normal(0, 2, 3)
    way, off = of.nearest(position, 0.0, 0.0)
    found = np.linalg.norm(dense - position, axis=1)
    assert off == pytest.approx(found.min(), abs=0.01)
    assert np.linalg.norm(dense[np.argmin(np.abs(ways - way))] - position) == pytest.approx(off, abs=0.02)


def test_where_a_path_crosses_itself_the_expected_pass_counts() -> None:
    poses = np.zeros((5, 7))
    poses[:, :2], poses[:, 6] = [(0, 0), (4, 0), (4, 2), (2, 2), (2, -2)], 1.0
    of = TimelessPath(poses, SpeedLimits(1.0), stops=True)
    assert of.nearest(np.array([2.02, 0.01, 0]), 0.0, 0.1)[0] == pytest.approx(2.02)
    assert of.nearest(np.array([2.02, 0.01, 0]), 9.0, 0.1)[0] == pytest.approx(9.99)


def fed(**plan: Any) -> Fed:
    return Fed(ROBOT, plans={"robot": {"topic": "/plan", **plan}}, rate=10)


def at(given: Fed, k: int, x: float, speed: float, y: float = 0.0) -> None:
    t = START + k * SECOND // 10
    given.give("/odom", t, odometry("map", t, (x, y, 0), STILL, (speed, 0, 0), (0, 0, 0)))


def plans_of(given: Fed) -> list[tuple[int, ObjectTrajectory]]:
    return [(message.stamp_ns, each) for message in given.plans for each in message.trajectories]


def test_a_path_begins_where_the_robot_is_with_its_speed() -> None:
    given = fed(speed=1.0, acceleration=0.5)
    at(given, 0, 2.0, 0.6)
    given.give("/plan", START, path([(0, 0, 0), (6, 0, 0)]))
    at(given, 1, 2.06, 0.6)
    ((stamp, plan),) = plans_of(given)
    assert stamp == START
    assert plan.poses[0, :3] == pytest.approx([2.0, 0, 0])
    assert (plan.poses[1, 0] - 2.0) / plan.times[1] == pytest.approx(0.6, abs=0.1)
    assert plan.times[-1] == pytest.approx(0.8 + 2.36 + 2.0, abs=0.02)


def test_a_robot_that_is_slower_than_its_path_gets_a_new_plan_and_one_that_keeps_its_speed_none() -> None:
    slow, steady = fed(speed=1.0), fed(speed=1.0)
    for robot, speed in ((slow, 0.5), (steady, 1.0)):
        at(robot, 0, 0.0, speed)
        robot.give("/plan", START, path([(0, 0, 0), (6, 0, 0)]))
        for k in range(1, 30):
            at(robot, k, 0.1 * k * speed, speed)
    assert len(plans_of(steady)) == 1
    assert 5 < len(plans_of(slow)) < 29
    stamp, plan = plans_of(slow)[-1]
    assert plan.poses[0, 0] == pytest.approx((stamp - START) / SECOND * 0.5)


def test_the_plans_on_a_long_path_are_short_and_follow_each_other() -> None:
    """1 km in steps of 5 cm: a robot that keeps to it gets a plan each 5 s, and one that stands gets small ones."""
    long = [(0.05 * k, 0, 0) for k in range(20_000)]
    moves, stands = fed(speed=1.0), fed(speed=1.0)
    for robot, speed in ((moves, 1.0), (stands, 0.0)):
        at(robot, 0, 0.0, speed)
        robot.give("/plan", START, path(long))
        for k in range(1, 131):
            at(robot, k, 0.1 * k * speed, speed)
        assert max(len(plan.times) for _, plan in plans_of(robot)) < 250
        assert all(plan.then == Then.GO_ON for _, plan in plans_of(robot))
    begins = [(stamp - START) / SECOND for stamp, _ in plans_of(moves)]
    assert begins == pytest.approx([0.0, 5.1, 10.2])
    for stamp, plan in plans_of(moves):
        assert plan.poses[0, 0] == pytest.approx((stamp - START) / SECOND)


def test_a_robot_beside_its_path_gets_no_new_plan_and_one_at_its_end_loses_it() -> None:
    given = fed(speed=1.0, tolerance={"across": 0.2})
    at(given, 0, 0.0, 1.0)
    given.give("/plan", START, path([(0, 0, 0), (2, 0, 0)]))
    for k in range(1, 8):
        at(given, k, 0.0, 0.0, y=0.5)
    assert len(plans_of(given)) == 1
    at(given, 8, 2.0, 0.0)
    _, plan = plans_of(given)[-1]
    assert len(plan.times) == 0


def test_quaternions_of_zeros_are_no_orientation() -> None:
    given = fed(speed=1.0)
    kind, message = path([(0, 0, 0), (0, 2, 0)])
    for each in message.poses:
        each.pose.orientation.w = 0.0
    given.give("/plan", START, (kind, message))
    at(given, 0, 0.0, 0.0)
    ((_, plan),) = plans_of(given)
    assert plan.poses[0, 3:] == pytest.approx([0, 0, sqrt(0.5), sqrt(0.5)])


@pytest.mark.parametrize("place", [(np.nan, 0, 0), (1e300, 0, 0)])
def test_a_path_to_nowhere_is_refused(place: Any) -> None:
    given = fed(speed=1.0, acceleration=0.5)
    given.give("/plan", START, path([(0, 0, 0), place, (1, 0, 0)]))
    ((text, count),) = given.refused.items()
    assert "got others at pose 1" in text and count == 1
