"""How much of a command passes the guard, against robots that are simulated until they stand."""

from __future__ import annotations

import math

import numpy as np
import pytest

from collision_monitor import ObjectDescription, Sphere
from collision_monitor.codec import AlertLevel, ObjectDescriptionArray, ObjectStateArray
from collision_monitor.records import STATE, StateFlag
from collision_monitor.ros.guard.guarded_objects import GuardedObjects
from collision_monitor.ros.guard.speed_limit import PASSES, Braking, NearPair, PartPose, Twist2, limited, verdict

BRAKING = Braking(deceleration=1.5, reaction=0.2, clearance=0.1)
NAN = math.nan


def at(heading: float = 0.0, vx: float = 0.0, vy: float = 0.0, turn: float = 0.0) -> PartPose:
    return PartPose((0.0, 0.0, 0.0), heading, (vx, vy, 0.0), (0.0, 0.0, turn))


ORIGIN = at()


def alert(
    gap: float, level: int = AlertLevel.CAUTION, closing: float = 0.0, direction: float = 0.0, time: float = math.inf
) -> NearPair:
    """The robot of radius 0.5 m at the origin, and an obstacle in that direction (rad)."""
    n = np.array([math.cos(direction), math.sin(direction), 0.0])
    own, other = tuple((0.5 * n).tolist()), tuple(((0.5 + gap) * n).tolist())
    return NearPair(1, "person", "guard", level, gap, closing, time, own, other, "text")


def factor(one: NearPair, command: Twist2, pose: PartPose = ORIGIN) -> float:
    return verdict(BRAKING, [one], {1: pose}, pose, command).factor


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


def test_a_command_toward_the_obstacle_is_scaled_to_the_allowed_speed() -> None:
    assert factor(alert(1.0), Twist2(2.0, 0, 0)) * 2.0 == pytest.approx(BRAKING.speed(1.0, 0.0))
    assert factor(alert(1.0), Twist2(0.2, 0, 0)) == 1.0


def test_a_command_away_from_the_obstacle_passes_and_one_beside_it_is_limited_by_its_part() -> None:
    near = alert(0.2, AlertLevel.CRITICAL)
    assert factor(near, Twist2(-1.0, 0, 0)) == 1.0
    assert factor(near, Twist2(1.0, 0, 0)) == 0.0
    assert factor(near, Twist2(0.0, 0, 0.5)) == 0.0  # it turns its corners into the obstacle
    turned = alert(0.2, AlertLevel.CRITICAL, direction=math.pi / 2)
    assert factor(turned, Twist2(1.0, 0, 0), pose=at(math.pi / 2)) == 0.0
    assert factor(turned, Twist2(1.0, 0, 0), pose=at(-math.pi / 2)) == 1.0


def test_a_robot_stands_before_an_obstacle_from_the_side_arrives() -> None:
    """Its command has no part toward the obstacle."""
    for speed in (0.3, 0.8, 2.0):
        aside = alert(1.0, closing=1.2, direction=math.pi / 2)
        passed = factor(aside, Twist2(speed, 0, 0), pose=at(vx=speed)) * speed
        assert 0.2 + passed / 1.5 <= (1.0 - 0.1) / 1.2 + 1e-9
        assert passed == pytest.approx(min(speed, 1.5 * (0.9 / 1.2 - 0.2)))
    near = alert(0.3, AlertLevel.CRITICAL, closing=1.2, direction=math.pi / 2)
    assert factor(near, Twist2(0.5, 0, 0)) == 0.0
    assert factor(near, Twist2(0.0, -1.3, 0)) == 1.0
    assert factor(near, Twist2(0.0, -0.5, 0)) == 0.0  # slower than the obstacle


def test_levels_scale_where_no_distance_is_known() -> None:
    for level, expected in ((1, 1.0), (2, 0.5), (3, 0.0)):
        unknown = alert(1.0, level)._replace(distance=NAN, at=(NAN,) * 3, to=(NAN,) * 3)
        assert factor(unknown, Twist2(1.0, 0, 0)) == expected
        assert factor(unknown, Twist2(-1.0, 0, 0)) == expected


def test_in_contact_nothing_passes_in_any_direction() -> None:
    for direction in np.linspace(-3, 3, 7):
        assert factor(alert(-0.05, AlertLevel.CRITICAL), Twist2(math.cos(direction), math.sin(direction), 0)) == 0.0


def test_the_worst_one_counts_whichever_object_of_the_robot_it_concerns() -> None:
    trailer = alert(0.1, 3)._replace(part=2)
    both = verdict(BRAKING, [alert(0.6), trailer], {1: ORIGIN, 2: at()}, ORIGIN, Twist2(1.0, 0, 0))
    assert (both.factor, both.rule) == (0.0, "guard")
    assert both.reason.startswith("critical")
    assert verdict(BRAKING, [], {}, ORIGIN, Twist2(1.0, 0, 0)) == PASSES


def test_an_obstacle_that_approaches_allows_less() -> None:
    assert factor(alert(1.0, closing=1.0), Twist2(2.0, 0, 0)) < factor(alert(1.0), Twist2(2.0, 0, 0))
    own = factor(alert(1.0, closing=1.0), Twist2(2.0, 0, 0), pose=at(vx=1.0))
    assert own == factor(alert(1.0), Twist2(2.0, 0, 0))  # all of the closing speed is the robot's own


def test_a_turn_of_the_robot_itself_is_no_approach_of_the_obstacle() -> None:
    """Its corner at 0.5 m ahead and 0.3 m aside nears what stands at its left."""
    corner = NearPair(1, "wall", "guard", 1, 0.2, 0.5, math.inf, (0.5, 0.3, 0.0), (0.5, 0.5, 0.0), "text")
    turns = factor(corner, Twist2(0.0, 0.0, 1.0), at(turn=1.0))
    stands = factor(corner, Twist2(0.0, 0.0, 1.0))  # then all of the closing speed is the wall's
    assert turns > stands


@pytest.mark.parametrize("speed", [0.5, 1.0, 1.5])
def test_a_robot_beside_a_hall_of_one_piece_stands_before_its_end_wall(speed: float) -> None:
    """The nearest point is at the side; the end wall is known by the time to the predicted impact alone."""
    left, v, dt = 3.0, speed, 0.01
    while v > 1e-3 and left > 0.0:
        side = alert(0.3, AlertLevel.CAUTION, direction=math.pi / 2, time=left / v)
        allowed = factor(side, Twist2(speed, 0, 0), at(vx=v)) * speed
        change = min(max(allowed - v, -BRAKING.deceleration * dt), BRAKING.deceleration * dt)
        v, left = v + change, left - v * dt
        if allowed < 0.02:
            break
    assert left > 0.05
    aside = alert(0.3, AlertLevel.CAUTION, direction=math.pi / 2, time=0.1)
    assert factor(aside, Twist2(-speed, 0, 0), at(vx=speed)) == 1.0  # it turns back
    assert factor(aside, Twist2(speed, 0, 0)) == 1.0  # it stands: the hall comes to it, and other limits count


@pytest.mark.parametrize(
    ("reach", "ahead", "expected"),
    [
        (2.5, 0.0, BRAKING.speed(2.5, 0.0)),
        (0.0, 0.0, 0.0),
        (0.0, 0.1, 0.0),
        (1.0, math.inf, math.inf),
        (math.inf, 0.0, math.inf),
    ],
)
def test_what_the_rules_see_ahead_limits_the_speed(reach: float, ahead: float, expected: float) -> None:
    assert BRAKING.speed_ahead(reach, ahead) == pytest.approx(expected)


@pytest.mark.parametrize("ahead", [0.6, 1.0, 2.0])
@pytest.mark.parametrize("reach", [0.2, 0.5, 2.5])
def test_it_stops_from_that_speed_and_from_every_slower_one(reach: float, ahead: float) -> None:
    fastest = BRAKING.speed_ahead(reach, ahead)
    for speed in np.linspace(0.01, fastest, 40):
        seen = max(reach, speed * ahead)
        way = speed * BRAKING.reaction + speed**2 / (2 * BRAKING.deceleration)
        assert way <= (reach - BRAKING.clearance if speed <= BRAKING.speed(reach, 0.0) else seen) + 1e-9


def test_the_limit_scales_a_command_and_names_itself() -> None:
    found = limited(PASSES, Twist2(2.0, 0.0, 0.3), 1.5)
    assert (found.factor, found.reason) == (0.75, "what the rules see ahead allows 1.50 m/s")
    assert limited(PASSES, Twist2(1.0, 0.0, 0.3), 1.5) == PASSES
    assert limited(PASSES, Twist2(0.0, 0.0, 0.3), 0.0) == PASSES  # in place
    assert limited(PASSES, Twist2(0.1, 0.0, 0.0), 0.0).factor == 0.0


@pytest.mark.parametrize("heading", np.linspace(-3.0, 3.0, 9))
def test_the_factor_does_not_depend_on_where_the_robot_looks(heading: float) -> None:
    """It drives at 0.8 m/s toward an impact that is predicted in 1 s, with a near wall at its left."""
    factors = []
    for turned in (0.0, heading):
        side = alert(0.3, AlertLevel.CAUTION, direction=turned + math.pi / 2, time=0.3)
        pose = at(turned, 0.8 * math.cos(turned), 0.8 * math.sin(turned))
        factors.append(factor(side, Twist2(0.8, 0, 0), pose=pose))
    assert factors[1] == pytest.approx(factors[0])
    assert factors[0] < 1.0


def test_a_state_along_the_robots_own_axes_is_turned_to_the_world() -> None:
    row = np.zeros(1, STATE)
    row["id"], row["quaternion"], row["linear"] = 7, (0, 0, math.sin(math.pi / 4), math.cos(math.pi / 4)), (1, 0, 0)
    row["flags"] = StateFlag.BODY_TWIST
    guarded = GuardedObjects(("robot",), "robot")
    guarded.describe(ObjectDescriptionArray(0, "map", False, (ObjectDescription(7, Sphere(0.5), name="robot"),)))
    guarded.move(ObjectStateArray(5, "map", 0, row, np.empty(0)), 1.0)
    assert guarded.states[7].pose.linear == pytest.approx((0, 1, 0))
    assert guarded.states[7].pose.heading == pytest.approx(math.pi / 2)
