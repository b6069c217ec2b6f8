"""Velocity commands as a guard takes them and gives them: what it refuses, and what it makes of the others."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any, Final

from geometry_msgs.msg import TwistStamped

from collision_monitor.monitor.state.timeline import NANOSECOND
from collision_monitor.ros.durations import spoken
from collision_monitor.ros.guard.speed_limit import Twist2

COMPONENTS: Final = tuple((part, axis) for part in ("linear", "angular") for axis in "xyz")


def twist_of(command: Any) -> Any:
    """Return the Twist of a Twist or a TwistStamped."""
    return command.twist if isinstance(command, TwistStamped) else command


def in_plane(command: Any) -> Twist2:
    """Return the motion in the plane that a command asks for."""
    twist = twist_of(command)
    return Twist2(twist.linear.x, twist.linear.y, twist.angular.z)


def stamp_of(command: Any) -> int | None:
    """Return the stamp (ns) of a TwistStamped; None for a Twist."""
    if not isinstance(command, TwistStamped):
        return None
    stamp = command.header.stamp
    return int(stamp.sec) * 1_000_000_000 + int(stamp.nanosec)


def why_refused(command: Any, now_ns: int, most_age: float, most_ahead: float) -> str:
    """Return why a command must not pass; empty if it may. Ages in s."""
    for name, value in _values(command):
        if not math.isfinite(value):
            return f"the command is not finite: {name} is {value}"
    stamp = stamp_of(command)
    if stamp is None:
        return ""
    if stamp == 0:
        return "the command has no stamp"
    age = (now_ns - stamp) * NANOSECOND
    if age > most_age:
        return f"the command is {spoken(age)} old by its stamp"
    if age < -most_ahead:
        return f"the command is from the future: its stamp is {spoken(-age)} ahead"
    return ""


def scaled_command(command: Any, factor: float) -> Any:
    """Return the command times the factor, with its own header. At a factor of 0 every component is 0, NaN too."""
    made = type(command)()
    if isinstance(command, TwistStamped):
        made.header = command.header
    given, twist = twist_of(command), twist_of(made)
    for part, axis in COMPONENTS:
        value = getattr(getattr(given, part), axis)
        setattr(getattr(twist, part), axis, value * factor if factor else 0.0)
    return made


def stopped(command: Any, stamp: Any) -> Any:
    """Return a command to stand, stamped as the guard's own: it stands for one that is refused or too old."""
    made = scaled_command(command, 0.0)
    if isinstance(made, TwistStamped):
        made.header = type(made.header)(frame_id=command.header.frame_id, stamp=stamp)
    return made


def _values(command: Any) -> Iterator[tuple[str, float]]:
    twist = twist_of(command)
    for part, axis in COMPONENTS:
        yield f"{part}.{axis}", getattr(getattr(twist, part), axis)
