"""A guard between a planner and a base: passes velocity commands, scaled so that the robot stops before contact.

ros2 run collision_monitor guard --ros-args -p robot:=cart -r cmd_vel_in:=/cmd_vel_nav -r cmd_vel_out:=/cmd_vel

It relies on one message of one monitor, `~/raised_alerts`, which says what is near and whom the rules cover at a step.
Whatever that message does not say is a reason to stop.
"""

from __future__ import annotations

import time
from importlib import import_module
from typing import Any, Final

from geometry_msgs.msg import Twist, TwistStamped
from rclpy.clock import Clock
from rclpy.clock_type import ClockType
from rclpy.duration import Duration
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile
from std_msgs.msg import String

from collision_monitor import codec
from collision_monitor.errors import CollisionMonitorError, MessageError
from collision_monitor.pipeline.topics import GUARD_STATE, Topic
from collision_monitor.ros.endpoints import subscription
from collision_monitor.ros.guard.guard_parameters import read_guard_parameters
from collision_monitor.ros.guard.guard_report import Decision, GuardReport
from collision_monitor.ros.guard.guarded_objects import GuardedObjects
from collision_monitor.ros.guard.monitor_answers import ClockReading, Fault, MonitorAnswers
from collision_monitor.ros.guard.speed_limit import PASSES, SpeedVerdict, limited, verdict
from collision_monitor.ros.guard.velocity_commands import in_plane, scaled_command, stopped, why_refused
from collision_monitor.ros.health.diagnostics import Diagnostics, DiagnosticsParameters
from collision_monitor.ros.parameters import begin_node

PERIOD: Final = 0.05
"""s between two looks at the age of everything; a held stop is repeated so often."""

LAST_STOP: Final = 1.0
"""s that the end waits at most until the base has the last stop. A process has to end 2 s after a signal."""


class GuardNode(Node):
    """Passes commands from `cmd_vel_in` to `cmd_vel_out`. Raises InputError for impossible parameters."""

    def __init__(self) -> None:
        begin_node(self, "guard")
        try:
            self._parameters = read_guard_parameters(self)
        except CollisionMonitorError:
            self.destroy_node()
            raise
        given = self._parameters
        self._robot = GuardedObjects(given.patterns, given.base)
        self._answers = MonitorAnswers(given.monitor, given.limits)
        self._command: Any = None
        self._commanded = 0.0
        kind = TwistStamped if given.stamped else Twist
        self._out = self.create_publisher(kind, "cmd_vel_out", 1)
        self._report = GuardReport(self.get_logger(), self._robot)
        latched = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
        self._state_out = self.create_publisher(String, GUARD_STATE, latched)
        self._nav2 = _nav2_state()
        self._nav2_out = self._nav2 and self.create_publisher(self._nav2, "collision_monitor_state", 1)
        self._diagnostics = Diagnostics(self, self._report.reports, DiagnosticsParameters())
        # objects and states first: if all wait, the executor takes them in this order
        for topic, callback in (
            (Topic.MONITORED_SHAPES, self._on_shapes),  # with what the monitor reads from its sources
            (Topic.MONITORED_STATES, self._on_states),
            (Topic.RAISED_ALERTS, self._on_alerts),
        ):
            subscription(self, topic, callback, topic.of(given.monitor))
        self.create_subscription(kind, "cmd_vel_in", self._on_command, 1)
        self.create_timer(PERIOD, self._publish, clock=Clock(clock_type=ClockType.STEADY_TIME))
        self.get_logger().info(f"guards {', '.join(self._robot.patterns)} by the alerts of {given.monitor}")

    # -- the monitor

    def _on_shapes(self, data: bytes) -> None:
        try:
            self._robot.describe(codec.decode_descriptions(data))
        except MessageError as error:
            self._report.note_message(str(error))

    def _on_states(self, data: bytes) -> None:
        try:
            self._robot.move(codec.decode_states(data), time.monotonic())
        except MessageError as error:
            self._report.note_message(str(error))

    def _on_alerts(self, data: bytes) -> None:
        try:
            array = codec.decode_alerts(data)
        except MessageError as error:
            self._report.note_message(str(error))
            return
        self._answers.take(array, time.monotonic())
        self._publish()

    # -- commands

    def _on_command(self, command: Any) -> None:
        self._command, self._commanded = command, time.monotonic()
        self._publish()

    def _publish(self) -> None:
        """Publish the last command, scaled; a stop if it is too old or refused, or nothing can be relied on."""
        decision = self._decide()
        command = self._command
        if command is not None:
            if decision.is_over or decision.refused or decision.fault is not None:
                self.stop()
            else:
                self._out.publish(scaled_command(command, decision.verdict.factor))
            if decision.is_over:
                self._command = None
        if self._report.take(decision):
            self._tell(decision)

    def stop(self) -> None:
        """Publish a command to stand in place of the last one, if there is one."""
        if self._command is not None:
            self._out.publish(stopped(self._command, self.get_clock().now().to_msg()))

    def close(self) -> None:
        """Stop the base and leave. A message that nobody acknowledged yet would be lost with its publisher."""
        self.stop()
        self._out.wait_for_all_acked(Duration(seconds=LAST_STOP))
        self.destroy_node()

    def _decide(self) -> Decision:
        """Return what to do with the last command now. An error of the guard itself is a reason to stop."""
        try:
            return self._decided()
        except Exception as error:
            fault = Fault("error", f"an error of the guard: {error!r}; please report it")
            return Decision(SpeedVerdict(0.0, "", fault.text), fault)

    def _decided(self) -> Decision:
        now = ClockReading(int(self.get_clock().now().nanoseconds), time.monotonic())
        limits, command = self._parameters.limits, self._command
        is_over = command is not None and now.steady - self._commanded > limits.command
        fault = self._clock_fault(now) or self._answers.fault(self._robot, now)
        if fault is not None:
            return Decision(SpeedVerdict(0.0, "", fault.text), fault, is_over)
        doubts = tuple(self._answers.doubts(self._robot))
        if command is None or is_over:
            return Decision(PASSES, None, is_over, doubts)
        refused = why_refused(command, now.stamp_ns, limits.command, limits.ahead)
        if refused:
            return Decision(SpeedVerdict(0.0, "", refused), None, False, doubts, refused=True)
        return Decision(self._verdict(command), None, False, doubts)

    def _clock_fault(self, now: ClockReading) -> Fault | None:
        if now.stamp_ns > 0:
            return None
        return Fault("no clock", "no time on /clock yet, and use_sim_time is set")

    def _verdict(self, command: Any) -> SpeedVerdict:
        poses = {object_id: state.pose for object_id, state in self._robot.states.items()}
        base = self._robot.base
        assert base is not None  # else there was a fault
        motion, braking = in_plane(command), self._parameters.braking
        found = verdict(braking, self._answers.near(self._robot), poses, poses[base], motion)
        return limited(found, motion, self._answers.fastest(self._robot, braking))

    def _tell(self, decision: Decision) -> None:
        """Publish what the guard does, because that has changed."""
        self._state_out.publish(String(data=self._report.text))
        if self._nav2_out is not None:
            self._nav2_out.publish(self._nav2(action_type=int(decision.action), polygon_name=decision.verdict.rule))
        self._diagnostics.publish()


def _nav2_state() -> Any:
    """Return the class nav2_msgs/CollisionMonitorState, or None without that package."""
    try:
        return import_module("nav2_msgs.msg").CollisionMonitorState
    except (ImportError, AttributeError):
        return None
