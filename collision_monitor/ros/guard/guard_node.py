"""A guard between a planner and a base: passes velocity commands, scaled so that the robot stops before contact.

ros2 run collision_monitor guard --ros-args -p robot:=cart -r cmd_vel_in:=/cmd_vel_nav -r cmd_vel_out:=/cmd_vel
"""

from __future__ import annotations

import math
import time
from importlib import import_module
from typing import Any, Final

import numpy as np
from geometry_msgs.msg import Twist, TwistStamped
from rclpy.clock import Clock
from rclpy.clock_type import ClockType
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile
from std_msgs.msg import String

from collision_monitor import codec
from collision_monitor.errors import CollisionMonitorError, InputError, MessageError
from collision_monitor.pipeline.topics import GUARD_STATE, NODE, Topic
from collision_monitor.ros.endpoints import subscription
from collision_monitor.ros.guard.speed_limit import PASSES, Braking, RobotPose, SpeedVerdict, Twist2, verdict
from collision_monitor.ros.parameters import ParameterReader

PERIOD: Final = 0.05
"""s between two looks at the age of everything; a held stop is repeated so often."""

ALERTS_AGE: Final = 1.2
"""s: the monitor publishes all raised alerts at least twice a second, if it has rules."""

STOP, SLOWDOWN, NOTHING = 1, 2, 0
"""Actions of nav2_msgs/CollisionMonitorState."""

PARAMETERS: Final[tuple[str, ...]] = (
    *("robot", "monitor", "stamped", "max_age", "command_timeout", "deceleration", "reaction_time", "clearance"),
    *("caution_factor", "warning_factor", "critical_factor"),
)


class GuardNode(Node):
    """Passes commands from `cmd_vel_in` to `cmd_vel_out`. Raises InputError for impossible parameters."""

    def __init__(self) -> None:
        super().__init__("guard", automatically_declare_parameters_from_overrides=True)
        try:
            self._read_parameters()
        except CollisionMonitorError:
            self.destroy_node()
            raise
        self._robot: int | None = None
        self._pose: RobotPose | None = None
        self._alerts: tuple[codec.CollisionAlert, ...] = ()
        self._seen = dict.fromkeys(("status", "alerts", "robot"), -math.inf)  # steady time of the last news (s)
        self._step = -1
        self._robot_stamp = -1
        self._command: Any = None
        self._commanded = -math.inf
        self._said: tuple[int, str] = (-1, "")
        kind = TwistStamped if self._stamped else Twist
        self._out = self.create_publisher(kind, "cmd_vel_out", 1)
        self.create_subscription(kind, "cmd_vel_in", self._on_command, 1)
        latched = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
        self._state_out = self.create_publisher(String, GUARD_STATE, latched)
        self._nav2 = _nav2_state()
        self._nav2_out = self._nav2 and self.create_publisher(self._nav2, "collision_monitor_state", 1)
        for topic, callback in (
            (Topic.MONITORED_SHAPES, self._on_shapes),  # with what the monitor reads from its sources
            (Topic.MONITORED_STATES, self._on_states),
            (Topic.STATUS, self._on_status),
            (Topic.RAISED_ALERTS, self._on_alerts),
        ):
            subscription(self, topic, callback, topic.of(self._monitor))
        self.create_timer(PERIOD, self._publish, clock=Clock(clock_type=ClockType.STEADY_TIME))
        self.get_logger().info(f"guards {self._name} by the alerts of {self._monitor}")

    def _read_parameters(self) -> None:
        reader = ParameterReader(self, PARAMETERS)
        self._name = reader.read("robot", "", "Name of the robot's object in the monitor. Required.")
        self._monitor = reader.read("monitor", NODE, "Name of the monitor's node, with its namespace.").strip("/")
        self._stamped = reader.read("stamped", False, "Whether the commands are TwistStamped.")
        self._max_age = reader.read("max_age", 0.3, "Largest age of the monitor's answers. Unit: s.")
        text = "Time after a command until the guard stops the robot, unless there is another one. Unit: s."
        self._timeout = reader.read("command_timeout", 0.5, text)
        default = Braking()
        braking = Braking(
            reader.read("deceleration", default.deceleration, "Deceleration of a stop. Unit: m/s^2."),
            reader.read("reaction_time", default.reaction, "Time from a measurement to the brakes. Unit: s."),
            reader.read("clearance", default.clearance, "Distance that stays free at a stop. Unit: m."),
            reader.read("caution_factor", default.caution, "Factor on commands at caution."),
            reader.read("warning_factor", default.warning, "Factor on commands at warning."),
            reader.read("critical_factor", default.critical, "Factor on commands at critical; 0 stops."),
        )
        if not self._name:
            raise InputError("parameter robot: expected the name of the robot's object, got an empty text")
        for name in ("max_age", "command_timeout", "deceleration"):
            if not 1e-3 <= self.get_parameter(name).value <= 1000.0:
                raise InputError(f"parameter {name}: expected 0.001 to 1000, got {self.get_parameter(name).value:g}")
        for name in PARAMETERS[-5:]:
            most = 1.0 if name.endswith("_factor") else 100.0
            if not 0.0 <= self.get_parameter(name).value <= most:
                raise InputError(f"parameter {name}: expected 0 to {most:g}, got {self.get_parameter(name).value:g}")
        self._braking = braking

    # -- the monitor

    def _on_shapes(self, data: bytes) -> None:
        try:
            message = codec.decode_descriptions(data)
        except MessageError:
            return
        if message.snapshot:
            self._robot = None
        for each in message.objects:
            if isinstance(each, codec.Removal):
                self._robot = None if each.object_id == self._robot else self._robot
            elif each.name == self._name:
                self._robot = each.object_id

    def _on_states(self, data: bytes) -> None:
        try:
            message = codec.decode_states(data)
        except MessageError:
            return
        if self._robot is None or message.stamp_ns == self._robot_stamp:
            return
        rows = message.states[message.states["id"] == self._robot]
        if not len(rows):
            return
        row = rows[-1]
        x, y, z, w = row["quaternion"].tolist()
        heading = math.atan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z))
        values = (*row["position"][:2].tolist(), heading, *row["linear"][:2].tolist())
        if np.isfinite(values).all():
            self._pose, self._robot_stamp = RobotPose(*values), message.stamp_ns
            self._seen["robot"] = time.monotonic()

    def _on_status(self, data: bytes) -> None:
        try:
            status = codec.decode_status(data)
        except MessageError:
            return
        if status.step != self._step:
            self._step = status.step
            self._seen["status"] = time.monotonic()

    def _on_alerts(self, data: bytes) -> None:
        try:
            self._alerts = codec.decode_alerts(data).alerts
        except MessageError:
            return
        self._seen["alerts"] = time.monotonic()
        self._publish()

    # -- commands

    def _on_command(self, command: Any) -> None:
        self._command, self._commanded = command, time.monotonic()
        self._publish()

    def _publish(self) -> None:
        """Publish the last command, scaled; a stop if there is no new one or the monitor does not answer."""
        now = time.monotonic()
        found = self._verdict(now)
        self._report(found)
        if self._command is None:
            return
        if now - self._commanded > self._timeout:
            self._out.publish(_scaled(self._command, 0.0, self._stamp()))
            self._command = None
            return
        self._out.publish(_scaled(self._command, found.factor, self._stamp()))

    def _stamp(self) -> Any:
        return self.get_clock().now().to_msg()

    def _verdict(self, now: float) -> SpeedVerdict:
        missing = self._missing(now)
        if missing:
            return SpeedVerdict(0.0, "", missing)
        if self._command is None:
            return PASSES
        assert self._robot is not None
        assert self._pose is not None
        twist = self._command.twist if self._stamped else self._command
        command = Twist2(twist.linear.x, twist.linear.y, twist.angular.z)
        if not np.isfinite(command).all():
            return SpeedVerdict(0.0, "", "the command is not finite")
        return verdict(self._braking, self._alerts, self._robot, self._pose, command)

    def _missing(self, now: float) -> str:
        """Return which answer is missing, or empty."""
        age = {name: now - seen for name, seen in self._seen.items()}
        if self._seen["status"] == -math.inf:
            return f"no status of {self._monitor}: does the monitor run?"
        if age["status"] > self._max_age:
            return f"no step of {self._monitor} for {age['status']:.1f} s"
        if age["alerts"] > ALERTS_AGE:
            return f"no alerts of {self._monitor}: has it rules?"
        if self._robot is None:
            return f"no object is named {self._name!r}"
        if age["robot"] > self._max_age:
            return f"no state of {self._name!r} for {min(age['robot'], 1e4):.1f} s"
        return ""

    def _report(self, found: SpeedVerdict) -> None:
        """Log and publish what the guard does, when that changes."""
        action = NOTHING if found.factor == 1.0 else STOP if found.factor == 0.0 else SLOWDOWN
        key = found.rule or found.reason.partition(" for ")[0]  # an age that grows is no news
        if (action, key) == self._said:
            return
        self._said = action, key
        if self._nav2_out is not None:
            self._nav2_out.publish(self._nav2(action_type=action, polygon_name=found.rule))
        text = {NOTHING: "passes", SLOWDOWN: "slows down", STOP: "stops"}[action]
        text += f": {found.reason}" if found.reason else ""
        self._state_out.publish(String(data=text))
        if action == STOP:
            self.get_logger().warning(text)
        else:
            self.get_logger().info(text)


def _scaled(command: Any, factor: float, stamp: Any) -> Any:
    """Return the command times the factor; a stamped one with a new stamp. NaN becomes 0 at a factor of 0."""
    scaled = type(command)()
    given, made = command, scaled
    if isinstance(command, TwistStamped):
        scaled.header.frame_id, scaled.header.stamp = command.header.frame_id, stamp
        given, made = command.twist, scaled.twist
    for part in ("linear", "angular"):
        for axis in "xyz":
            value = getattr(getattr(given, part), axis)
            setattr(getattr(made, part), axis, value * factor if factor else 0.0)
    return scaled


def _nav2_state() -> Any:
    """Return the class nav2_msgs/CollisionMonitorState, or None without that package."""
    try:
        return import_module("nav2_msgs.msg").CollisionMonitorState
    except (ImportError, AttributeError):
        return None
