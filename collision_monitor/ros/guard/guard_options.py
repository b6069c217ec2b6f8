"""The parameters of the guard: their names, ranges and texts in one table, for the node and for `guard --help`."""

from __future__ import annotations

from typing import Final, NamedTuple

from collision_monitor.ros.guard.guard_limits import GuardLimits
from collision_monitor.ros.guard.speed_limit import Braking
from collision_monitor.settings.parameter_file import NODE

_BRAKING, _LIMITS = Braking(), GuardLimits()


class NumberParameter(NamedTuple):
    """A parameter that is a number: its name, default, range, unit and text."""

    name: str
    default: float
    least: float
    most: float
    unit: str
    text: str


NUMBERS: Final = (
    NumberParameter("max_age", _LIMITS.max_age, 1e-3, 1e3, "s", "Largest age of the monitor's answers and states."),
    NumberParameter("command_timeout", _LIMITS.command, 1e-3, 1e3, "s", "Largest age of a command."),
    NumberParameter(
        "obstacle_timeout", _LIMITS.obstacle, 1e-3, 1e3, "s", "Largest age of a state of what the rules name."
    ),
    NumberParameter("clock_tolerance", _LIMITS.ahead, 0.0, 1e3, "s", "Largest time by which a stamp may be ahead."),
    NumberParameter("deceleration", _BRAKING.deceleration, 1e-3, 1e3, "m/s^2", "Deceleration of a stop."),
    NumberParameter(
        "reaction_time", _BRAKING.reaction, 0.0, 100.0, "s", "From a measurement to the brakes; max_age counts if more."
    ),
    NumberParameter("clearance", _BRAKING.clearance, 0.0, 100.0, "m", "Distance that stays free at a stop."),
    NumberParameter("caution_factor", _BRAKING.caution, 0.0, 1.0, "", "Factor on commands at caution."),
    NumberParameter("warning_factor", _BRAKING.warning, 0.0, 1.0, "", "Factor on commands at warning."),
    NumberParameter("critical_factor", _BRAKING.critical, 0.0, 1.0, "", "Factor on commands at critical; 0 stops."),
)

ROBOT: Final = "Names of the robot's objects in the monitor, separated by commas, with wildcards (*, ?). Required."
BASE: Final = "Name of the object whose frame the commands have. Empty: the first name of `robot`."
MONITOR: Final = "Name of the monitor's node, with its namespace."
STAMPED: Final = "Whether the commands are TwistStamped."

NAMES: Final = ("robot", "base", "monitor", "stamped", *(each.name for each in NUMBERS))


_HELP: Final = """\
usage: guard [--help] --ros-args -p robot:=NAMES [-p NAME:=VALUE ...] [-r FROM:=TO ...]

A node between a planner and a base. It passes velocity commands, scaled by the alerts of the robot
and by the distance that stopping takes. Without a fresh answer of one monitor whose rules cover the
robot, it stops the robot and says why.

topics:
  cmd_vel_in               subscribed: geometry_msgs/Twist, or TwistStamped with `stamped`
  cmd_vel_out              published: the same, scaled
  ~/state                  published, latched: std_msgs/String, what it does and why
  /diagnostics             published: an ERROR while it cannot guard
  collision_monitor_state  published: nav2_msgs/CollisionMonitorState, if nav2_msgs is installed

parameters:
{parameters}

examples:
  ros2 run collision_monitor guard --ros-args -p robot:=robot_1 -r cmd_vel_in:=/cmd_vel_nav -r cmd_vel_out:=/cmd_vel
  ros2 run collision_monitor guard --ros-args -p robot:="base_link,arm/*,trailer"

exit codes:
  0  stopped by SIGINT or SIGTERM
  2  the node refuses a parameter

docs/guard.md explains what passes and when it stops.
"""


def guard_help() -> str:
    """Return the text of `guard --help`."""
    rows = [("robot", "", ROBOT), ("base", "", BASE), ("monitor", NODE, MONITOR), ("stamped", "false", STAMPED)]
    rows += [(each.name, f"{each.default:g} {each.unit}".strip(), each.text) for each in NUMBERS]
    return _HELP.format(parameters="\n".join(parameter_row(*each) for each in rows))


def parameter_row(name: str, default: str, text: str) -> str:
    """Return the line of a parameter in a help text."""
    return f"  {name:<17} {text}{f' Default: {default}.' if default else ''}"
