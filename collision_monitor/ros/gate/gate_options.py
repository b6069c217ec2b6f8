"""The parameters of the gate: their names, ranges and texts in one table, for the node and for `gate --help`."""

from __future__ import annotations

from typing import Final

from collision_monitor.ros.gate.gate_limits import GateLimits
from collision_monitor.ros.guard.guard_limits import GuardLimits
from collision_monitor.ros.guard.guard_options import BASE, MONITOR, ROBOT, NumberParameter, parameter_row
from collision_monitor.settings.parameter_file import NODE

_AGES, _LIMITS = GuardLimits(), GateLimits()

AGES: Final = (
    NumberParameter("max_age", _AGES.max_age, 1e-3, 1e3, "s", "Largest age of the monitor's answers and states."),
    NumberParameter("command_timeout", _AGES.command, 1e-3, 1e3, "s", "Largest age of a velocity command."),
    NumberParameter("obstacle_timeout", _AGES.obstacle, 1e-3, 1e3, "s", "Largest age of a state of any other object."),
    NumberParameter("clock_tolerance", _AGES.ahead, 0.0, 1e3, "s", "Largest time by which a stamp may be ahead."),
)
LIMITS: Final = (
    NumberParameter("clearance", _LIMITS.clearance, 0.0, 10.0, "m", "Distance to keep from everything."),
    NumberParameter(
        "reaction_time", _LIMITS.reaction, 0.0, 10.0, "s", "From a measurement to the brakes; max_age counts if more."
    ),
    NumberParameter("stop_time", _LIMITS.stop_time, 1e-2, 60.0, "s", "From the planned speed to a stop."),
    NumberParameter("ahead", _LIMITS.ahead, 0.0, 600.0, "s", "How long motions of moving objects are relied on."),
    NumberParameter("tolerance", _LIMITS.tolerance, 1e-4, 10.0, "m", "How far the robot may be off its plan."),
    NumberParameter("time_tolerance", _LIMITS.time_tolerance, 1e-3, 60.0, "s", "How late or early it may be on it."),
    NumberParameter(
        "start_tolerance", _LIMITS.start_tolerance, 0.0, 10.0, "rad or m", "From the joints to a first point at 0 s."
    ),
    NumberParameter("speed", _LIMITS.speed, 1e-3, 100.0, "m/s", "Largest speed of a base along a path."),
)

URDF: Final = "Path of the URDF of an arm. Empty: `urdf_topic`, or a base that follows a Path."
URDF_TOPIC: Final = "Topic of a latched String with the URDF, such as /robot_description."
JOINT_STATES: Final = "Topic of the joint states of an arm."
CARRIER: Final = "Link that carries the objects of the robot that are no links, such as a load."
STAMPED: Final = "Whether the velocity commands are TwistStamped."

TEXTS: Final = (
    ("base", "", BASE),
    ("monitor", NODE, MONITOR),
    ("urdf", "", URDF),
    ("urdf_topic", "", URDF_TOPIC),
    ("joint_states", "/joint_states", JOINT_STATES),
    ("carrier", "", CARRIER),
)
NAMES: Final = ("robot", *(name for name, _, _ in TEXTS), "stamped", *(each.name for each in (*AGES, *LIMITS)))

_HELP: Final = """\
usage: gate [--help] --ros-args -p robot:=NAMES [-p NAME:=VALUE ...] [-r FROM:=TO ...]

A node between a planner and a controller. A plan goes through if it is clear, for certain, to its end:
every object of the robot keeps its distance from all that the monitor monitors. While the plan is
executed, the gate slows it down or stops it before a conflict, and says which pair, when and where.
Without a fresh answer of one monitor it stops the robot.

An arm (with `urdf` or `urdf_topic`):
  joint_trajectory_in      subscribed: trajectory_msgs/JointTrajectory; without points: stop
  joint_trajectory_out     published: the same; at another rate when the gate slows down, stops, goes on
A base (without):
  path_in                  subscribed: nav_msgs/Path; without poses: stop
  path_out                 published: the same
Both:
  cmd_vel_in, cmd_vel_out  geometry_msgs/Twist, or TwistStamped with `stamped`: of the follower of the path, scaled
  ~/speed_scale            published, latched: std_msgs/Float64, 0 (stop) to 1
  ~/check_trajectory       service: collision_monitor_msgs/srv/CheckTrajectory: judges a plan, executes nothing
  ~/state                  published, latched: std_msgs/String, what it does and why
  /diagnostics             published: an ERROR while it cannot judge

parameters:
{parameters}

examples:
  ros2 run collision_monitor gate --ros-args -p robot:="arm/*" -p base:=arm/base -p urdf:=arm.urdf \\
      -r joint_trajectory_in:=/planned -r joint_trajectory_out:=/arm_controller/joint_trajectory
  ros2 run collision_monitor gate --ros-args -p robot:="cart,load" -p speed:=0.8 \\
      -r path_in:=/plan -r path_out:=/checked_plan -r cmd_vel_in:=/cmd_vel_nav -r cmd_vel_out:=/cmd_vel

exit codes:
  0  stopped by SIGINT or SIGTERM
  2  the node refuses a parameter

docs/gate.md explains what goes through and when it stops.
"""


def gate_help() -> str:
    """Return the text of `gate --help`."""
    rows = [("robot", "", ROBOT), *TEXTS, ("stamped", "false", STAMPED)]
    rows += [(each.name, f"{each.default:g} {each.unit}".strip(), each.text) for each in (*AGES, *LIMITS)]
    return _HELP.format(parameters="\n".join(parameter_row(*each) for each in rows))
