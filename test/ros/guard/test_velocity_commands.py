"""Which commands a guard refuses, and what it makes of them."""

from __future__ import annotations

import math

import pytest

pytest.importorskip("geometry_msgs.msg")
from builtin_interfaces.msg import Time
from geometry_msgs.msg import Twist, TwistStamped

from collision_monitor.ros.durations import spoken
from collision_monitor.ros.guard.velocity_commands import (
    COMPONENTS,
    scaled_command,
    stopped,
    twist_of,
    why_refused,
)

SECOND = 1_000_000_000
NOW = 1_700_000_000 * SECOND


def twist(**values: float) -> Twist:
    made = Twist()
    for name, value in values.items():
        part, axis = name.split("_")
        setattr(getattr(made, part), axis, value)
    return made


def stamped(seconds: float, **values: float) -> TwistStamped:
    made = TwistStamped(twist=twist(**values))
    made.header.frame_id = "base_link"
    total = NOW + round(seconds * SECOND)
    made.header.stamp = Time(sec=total // SECOND, nanosec=total % SECOND)
    return made


def values(command: Twist | TwistStamped) -> list[float]:
    return [getattr(getattr(twist_of(command), part), axis) for part, axis in COMPONENTS]


@pytest.mark.parametrize(("part", "axis"), COMPONENTS)
@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf])
@pytest.mark.parametrize("kind", [Twist, TwistStamped])
def test_a_component_that_is_not_finite_is_refused_and_stops(part: str, axis: str, value: float, kind: type) -> None:
    given = twist(**{"linear_x": 0.5, f"{part}_{axis}": value})
    command = given if kind is Twist else TwistStamped(header=stamped(0.0).header, twist=given)
    reason = why_refused(command, NOW, 0.5, 0.1)
    assert reason == f"the command is not finite: {part}.{axis} is {value}"
    assert values(stopped(command, Time())) == [0.0] * 6
    assert values(scaled_command(command, 0.0)) == [0.0] * 6


@pytest.mark.parametrize(
    ("seconds", "reason"),
    [
        (-0.4, ""),
        (0.05, ""),
        (-0.6, "the command is 0.6 s old by its stamp"),
        (-7200.0, "the command is 2 h old by its stamp"),
        (0.3, "the command is from the future: its stamp is 0.3 s ahead"),
        (86400.0 * 365, "the command is from the future: its stamp is 365 days ahead"),
        (-NOW / SECOND, "the command has no stamp"),
        (-NOW / SECOND + 5.0, "the command is 19676 days old by its stamp"),
    ],
)
def test_stamps_that_are_too_old_or_ahead_are_refused(seconds: float, reason: str) -> None:
    assert why_refused(stamped(seconds, linear_x=0.5), NOW, 0.5, 0.1) == reason


def test_a_command_that_passes_keeps_its_header_and_all_components_scale() -> None:
    given = stamped(-0.2, **{f"{part}_{axis}": k + 1.0 for k, (part, axis) in enumerate(COMPONENTS)})
    made = scaled_command(given, 0.5)
    assert made.header == given.header
    assert values(made) == [0.5, 1.0, 1.5, 2.0, 2.5, 3.0]
    assert values(given)[0] == 1.0
    assert values(scaled_command(twist(linear_y=-2.0), 1.0)) == [0.0, -2.0, 0.0, 0.0, 0.0, 0.0]


def test_a_stop_in_place_of_a_refused_command_is_stamped_now() -> None:
    made = stopped(stamped(86400.0, linear_x=1.0), Time(sec=5))
    assert (made.header.stamp.sec, made.header.frame_id, values(made)) == (5, "base_link", [0.0] * 6)


@pytest.mark.parametrize(
    ("seconds", "words"), [(0.04, "0.0 s"), (1.25, "1.2 s"), (119.0, "119.0 s"), (120.0, "2 min"), (1e9, "11574 days")]
)
def test_durations_are_spoken(seconds: float, words: str) -> None:
    assert spoken(seconds) == words
