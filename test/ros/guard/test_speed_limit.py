"""How much of a command passes the guard, against robots that are simulated until they stand."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from collision_monitor.codec import AlertLevel, CollisionAlert
from collision_monitor.ros.guard.speed_limit import Braking, RobotPose, Twist2, verdict

BRAKING = Braking(deceleration=1.5, reaction=0.2, clearance=0.1)
NAN = math.nan
ORIGIN = RobotPose(0.0, 0.0, 0.0)


def alert(
    gap: float, level: int = AlertLevel.CAUTION, closing: float = 0.0, direction: float = 0.0, robot: int = 1
) -> CollisionAlert:
    """The robot of radius 0.5 m at the origin, and an obstacle in that direction (rad)."""
    n = np.array([math.cos(direction), math.sin(direction), 0.0])
    at, to = tuple((0.5 * n).tolist()), tuple(((0.5 + gap) * n).tolist())
    points = (at, to) if robot == 1 else (to, at)
    names = ("robot", "person") if robot == 1 else ("person", "robot")
    numbers = dict.fromkeys(("probability", "time_to_closest_approach", "distance_at_closest_approach"), NAN)
    rest = dict.fromkeys(("required_deceleration", "time_headway", "post_encroachment_time", "separation_margin"), NAN)
    return CollisionAlert(
        0, "world", 1, 1, 0, 9.0, 9.0, distance=gap, distance_error=0.0, closing_speed=closing, **numbers, **rest,
        point_a=points[0], point_b=points[1], id_a=1, id_b=2, level=level, previous_level=0, cause=0, rule="guard",
        name_a=names[0], name_b=names[1], class_a="", class_b="", text="text",
    )  # fmt: skip


def factor(one: CollisionAlert, command: Twist2, robot: int = 1, pose: RobotPose = ORIGIN) -> float:
    return verdict(BRAKING, [one], robot, pose, command).factor


@pytest.mark.parametrize("gap", [0.05, 0.3, 1.0, 3.0])
@pytest.mark.parametrize("approach", [-0.5, 0.0, 0.8])
def test_a_robot_at_the_allowed_speed_stops_at_the_clearance(gap: float, approach: float) -> None:
    allowed = BRAKING.speed(gap, approach)
    left, speed, time, dt = gap, allowed, 0.0, 1e-4
    while speed > 0.0:
        left -= (speed + max(approach, 0.0)) * dt
        time += dt
        speed = max(0.0, speed - 1.5 * dt) if time >= 0.2 else speed
    if allowed > 0.0:
        assert left == pytest.approx(0.1, abs=2e-3)
    else:
        assert gap - max(approach, 0.0) * 0.2 <= 0.1 + 1e-9


@pytest.mark.parametrize("robot", [1, 2])
def test_a_command_toward_the_obstacle_is_scaled_to_the_allowed_speed(robot: int) -> None:
    found = factor(alert(1.0, robot=robot), Twist2(2.0, 0, 0), robot)
    assert found * 2.0 == pytest.approx(BRAKING.speed(1.0, 0.0))
    assert factor(alert(1.0, robot=robot), Twist2(0.2, 0, 0), robot) == 1.0


def test_a_command_away_from_the_obstacle_passes_and_one_beside_it_is_limited_by_its_part() -> None:
    near = alert(0.2, AlertLevel.CRITICAL)
    assert factor(near, Twist2(-1.0, 0, 0)) == 1.0
    assert factor(near, Twist2(1.0, 0, 0)) == 0.0
    assert factor(near, Twist2(0.0, 0, 0.5)) == 0.0  # it turns its corners into the obstacle
    turned = alert(0.2, AlertLevel.CRITICAL, direction=math.pi / 2)
    assert factor(turned, Twist2(1.0, 0, 0), pose=RobotPose(0, 0, math.pi / 2)) == 0.0
    assert factor(turned, Twist2(1.0, 0, 0), pose=RobotPose(0, 0, -math.pi / 2)) == 1.0


def test_a_robot_stands_before_an_obstacle_from_the_side_arrives() -> None:
    """Its command has no part toward the obstacle."""
    for speed in (0.3, 0.8, 2.0):
        aside = alert(1.0, closing=1.2, direction=math.pi / 2)
        passed = factor(aside, Twist2(speed, 0, 0), pose=RobotPose(0, 0, 0, speed, 0.0)) * speed
        assert 0.2 + passed / 1.5 <= (1.0 - 0.1) / 1.2 + 1e-9
        assert passed == pytest.approx(min(speed, 1.5 * (0.9 / 1.2 - 0.2)))
    near = alert(0.3, AlertLevel.CRITICAL, closing=1.2, direction=math.pi / 2)
    assert factor(near, Twist2(0.5, 0, 0)) == 0.0
    assert factor(near, Twist2(0.0, -1.3, 0)) == 1.0
    assert factor(near, Twist2(0.0, -0.5, 0)) == 0.0  # slower than the obstacle


def test_levels_scale_where_no_distance_is_known() -> None:
    for level, expected in ((1, 1.0), (2, 0.5), (3, 0.0)):
        unknown = replace(alert(1.0, level), distance=NAN, point_a=(NAN,) * 3, point_b=(NAN,) * 3)
        assert factor(unknown, Twist2(1.0, 0, 0)) == expected
        assert factor(unknown, Twist2(-1.0, 0, 0)) == expected


def test_in_contact_nothing_passes_in_any_direction() -> None:
    for direction in np.linspace(-3, 3, 7):
        assert factor(alert(-0.05, AlertLevel.CRITICAL), Twist2(math.cos(direction), math.sin(direction), 0)) == 0.0


def test_alerts_of_others_do_not_count_and_the_worst_one_does() -> None:
    pose, command = RobotPose(0, 0, 0), Twist2(1.0, 0, 0)
    assert verdict(BRAKING, [alert(0.1, 3)], 7, pose, command).factor == 1.0
    both = verdict(BRAKING, [alert(0.6), alert(0.1, 3)], 1, pose, command)
    assert (both.factor, both.rule) == (0.0, "guard")
    assert both.reason.startswith("critical")


def test_an_obstacle_that_approaches_allows_less() -> None:
    assert factor(alert(1.0, closing=1.0), Twist2(2.0, 0, 0)) < factor(alert(1.0), Twist2(2.0, 0, 0))
    own = factor(alert(1.0, closing=1.0), Twist2(2.0, 0, 0), pose=RobotPose(0, 0, 0, 1.0, 0.0))
    assert own == factor(alert(1.0), Twist2(2.0, 0, 0))  # all of the closing speed is the robot's own
