"""A gate between a planner and a controller: lets plans through that are clear, and slows down or stops what goes on.

ros2 run collision_monitor gate --ros-args -p robot:="arm/*" -p base:=arm/base -p urdf:=arm.urdf

It looks at the world by itself, with the states that the monitor accepted at its last step. So a plan is judged to its
end, however far the monitor looks ahead, and a stop is due one message after the step that shows its reason.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from pathlib import Path
from typing import Any, Final

from geometry_msgs.msg import Twist, TwistStamped
from nav_msgs.msg import Path as PathMessage
from rclpy.clock import Clock
from rclpy.clock_type import ClockType
from rclpy.duration import Duration
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64, String
from trajectory_msgs.msg import JointTrajectory

from collision_monitor import codec
from collision_monitor.errors import CollisionMonitorError, InputError, MessageError
from collision_monitor.pipeline.topics import GUARD_STATE, SPEED_SCALE, Topic
from collision_monitor.robots.kinematic_tree import kinematic_tree
from collision_monitor.robots.link_plans import load_link_plans
from collision_monitor.robots.robot import Description
from collision_monitor.robots.urdf import parse_urdf
from collision_monitor.ros.endpoints import subscription
from collision_monitor.ros.gate.arm_plans import GatedArm, message_at, message_to_hold
from collision_monitor.ros.gate.base_plans import base_plan
from collision_monitor.ros.gate.checking import CheckService
from collision_monitor.ros.gate.gate_parameters import read_gate_parameters
from collision_monitor.ros.gate.gated_commands import GatedCommands
from collision_monitor.ros.gate.gated_plan import GatedPlan, RateChange
from collision_monitor.ros.gate.gatekeeper import Gatekeeper, LeftPlanError
from collision_monitor.ros.gate.plan_conflicts import load_plan_conflicts
from collision_monitor.ros.guard.guard_report import Decision, GuardReport
from collision_monitor.ros.guard.monitor_answers import ClockReading, Fault
from collision_monitor.ros.guard.speed_limit import SpeedVerdict
from collision_monitor.ros.health.diagnostics import Diagnostics, DiagnosticsParameters
from collision_monitor.ros.parameters import begin_node
from collision_monitor.sources.robot.joint_table import JointTable

PERIOD: Final = 0.05
"""s between two looks at the age of everything."""

SOONEST: Final = 0.02
"""s between two looks at the world, however fast the monitor steps."""

LAST_STOP: Final = 1.0
"""s that the end waits at most until the controller has the last stop. A process has to end 2 s after a signal."""


class GateNode(Node):
    """Passes plans from `joint_trajectory_in` or `path_in`. Raises InputError for impossible parameters."""

    def __init__(self) -> None:
        begin_node(self, "gate")
        try:
            self._given = given = read_gate_parameters(self)
            self._arm: GatedArm | None = None
            self._joints: JointTable | None = None
            if given.urdf:
                self._use(Description.read(Path(given.urdf)))
        except CollisionMonitorError:
            self.destroy_node()
            raise
        load_plan_conflicts()
        self._keeper = Gatekeeper(given.patterns, given.base, given.monitor, given.ages, given.limits)
        self._looked = 0.0
        self._report = GuardReport(self.get_logger(), self._keeper.world.robot, "gate")
        latched = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
        self._state_out = self.create_publisher(String, GUARD_STATE, latched)
        self._scale_out = self.create_publisher(Float64, SPEED_SCALE, latched)
        self._scale: float | None = None
        self._diagnostics = Diagnostics(self, self._report.reports, DiagnosticsParameters())
        for topic, callback in (
            (Topic.MONITORED_SHAPES, self._on_shapes),
            (Topic.MONITORED_STATES, self._on_states),
            (Topic.RAISED_ALERTS, self._on_alerts),
        ):
            subscription(self, topic, callback, topic.of(given.monitor))
        kind = TwistStamped if given.stamped else Twist
        self._commands = GatedCommands(self.create_publisher(kind, "cmd_vel_out", 1), given.ages, given.limits.speed)
        self.create_subscription(kind, "cmd_vel_in", self._on_command, 1)
        if given.is_arm:
            self._plan_out = self.create_publisher(JointTrajectory, "joint_trajectory_out", 10)
            self.create_subscription(JointTrajectory, "joint_trajectory_in", self._on_plan, 10)
            self.create_subscription(JointState, given.joint_states, self._on_joints, 10)
            if given.urdf_topic:
                self.create_subscription(String, given.urdf_topic, self._on_urdf, latched)
            load_link_plans()
        else:
            self._plan_out = self.create_publisher(PathMessage, "path_out", 10)
            self.create_subscription(PathMessage, "path_in", self._on_plan, 10)
        self._check = CheckService(self, self._keeper, self._made, self._reading)
        self.create_timer(PERIOD, self._on_timer, clock=Clock(clock_type=ClockType.STEADY_TIME))
        self.get_logger().info(f"gates {', '.join(given.patterns)} by what {given.monitor} monitors")

    # -- the robot

    def _use(self, urdf: Description) -> None:
        tree = kinematic_tree(parse_urdf(urdf.text, urdf.name))
        self._arm, self._joints = GatedArm(tree, self._given.carrier), JointTable(tree, self._given.ages.max_age)

    def _on_urdf(self, message: Any) -> None:
        try:
            self._use(Description(message.data, self._given.urdf_topic))
        except InputError as error:
            self._report.note_message(str(error))

    def _on_joints(self, message: Any) -> None:
        stamp = int(message.header.stamp.sec) * 1_000_000_000 + int(message.header.stamp.nanosec)
        if self._joints is not None:
            self._joints.take(message, stamp or self._reading().stamp_ns)

    # -- the monitor

    def _on_shapes(self, data: bytes) -> None:
        try:
            self._keeper.world.describe(codec.decode_descriptions(data))
        except MessageError as error:
            self._report.note_message(str(error))

    def _on_states(self, data: bytes) -> None:
        try:
            self._keeper.world.move(codec.decode_states(data), time.monotonic())
        except MessageError as error:
            self._report.note_message(str(error))

    def _on_alerts(self, data: bytes) -> None:
        try:
            self._keeper.answers.take(codec.decode_alerts(data), time.monotonic())
        except MessageError as error:
            self._report.note_message(str(error))
            return
        self._look()

    # -- plans

    def _on_plan(self, message: Any) -> None:
        """Judge a plan, which takes the place of the one before. One that does not go through stops the robot."""
        keeper, now = self._keeper, self._reading()
        if not len(message.points if self._given.is_arm else message.poses):
            self._end("the planner ended the plan")
            return
        plan, judgement = keeper.judge(self._made(message), now)
        if judgement.text or plan is None:
            self._end(f"refused a plan: {judgement.text}")
            return
        keeper.begin(plan, self._reading().stamp_ns, timed=self._given.is_arm)
        self._plan_out.publish(message)
        self._look()

    def _made(self, message: Any) -> Callable[[], GatedPlan]:
        """Return what makes the plan of a message; it raises InputError."""
        return lambda: self._plan_of(message)

    def _plan_of(self, message: Any) -> GatedPlan:
        keeper, now_ns, limits = self._keeper, self._reading().stamp_ns, self._given.limits
        if isinstance(message, PathMessage):
            if self._given.is_arm:
                raise InputError("expected a trajectory, got a path: the robot is an arm")
            base = keeper.world.robot.base
            assert base is not None  # else there was a fault
            return base_plan(message, keeper.world, base, now_ns, limits.speed, limits.tolerance)
        if self._arm is None or self._joints is None:
            raise InputError(f"expected the URDF on {self._given.urdf_topic or 'urdf_topic'} before a trajectory")
        values, known, _ = self._joints.at(now_ns)
        if not known.all():
            lacking = [name for name, is_known in zip(self._arm.tree.joints, known, strict=True) if not is_known]
            raise InputError(f"no joint states of {', '.join(lacking)} on {self._given.joint_states} for max_age")
        return self._arm.plan(message, values, keeper.world, now_ns, limits.start_tolerance)

    def _end(self, why: str) -> None:
        """Stop the robot, and follow no plan any more."""
        it, now = self._keeper.execution, self._reading()
        if it is not None and it.timed:
            self._send(it.go_on_at(0.0, now.stamp_ns))
        elif it is not None:
            self._plan_out.publish(PathMessage())
        self._keeper.drop(why)
        self._look()

    # -- what goes on

    def _on_command(self, command: Any) -> None:
        self._commands.take(command, time.monotonic())
        self._publish_command()

    def _on_timer(self) -> None:
        self._look()
        self._publish_command()

    def _look(self) -> None:
        """Decide how the plan goes on, and tell the controller."""
        if time.monotonic() - self._looked < SOONEST and self._keeper.execution is not None:
            return
        decision, change = self._decided()
        self._looked = time.monotonic()
        if change is not None:
            self._send(change)
        self._tell(decision)

    def _decided(self) -> tuple[Decision, RateChange | None]:
        """Return what to do now. An error of the gate itself is a reason to stop."""
        now, it = self._reading(), self._keeper.execution
        try:
            return self._keeper.decide(now)
        except LeftPlanError as error:
            self._leave(str(error))
            return Decision(SpeedVerdict(0.0, "", str(error)), refused=True), None
        except Exception as error:
            fault = Fault("error", f"an error of the gate: {error!r}; please report it")
            change = None if it is None or it.change.target == 0.0 else it.go_on_at(0.0, now.stamp_ns)
            return Decision(SpeedVerdict(0.0, "", fault.text), fault), change

    def _leave(self, why: str) -> None:
        """Drop a plan that the robot does not follow, and let it stop where it is."""
        it, joints = self._keeper.execution, self._joints
        if it is not None and it.timed and joints is not None:
            values, _, _ = joints.at(self._reading().stamp_ns)
            self._plan_out.publish(message_to_hold(it.plan.source, values, self._given.limits.stop_time))
        else:
            self._plan_out.publish(PathMessage())
        self._keeper.drop(why)

    def _send(self, change: RateChange) -> None:
        it = self._keeper.execution
        if it is not None and it.timed:
            self._plan_out.publish(message_at(it.plan.source, change))

    def _tell(self, decision: Decision) -> None:
        """Publish what the gate does, because that has changed."""
        factor = decision.verdict.factor
        self._commands.factor = factor
        if factor != self._scale:
            self._scale = factor
            self._scale_out.publish(Float64(data=factor))
            self._publish_command()
        if self._report.take(decision):
            self._state_out.publish(String(data=self._report.text))
            self._diagnostics.publish()
        it = self._keeper.execution
        if it is not None and it.is_over(self._reading().stamp_ns):
            self._keeper.drop("")

    def _publish_command(self) -> None:
        now = self._reading()
        self._commands.publish(now, self.get_clock().now().to_msg())

    def _reading(self) -> ClockReading:
        return ClockReading(int(self.get_clock().now().nanoseconds), time.monotonic())

    def close(self) -> None:
        """Stop the robot and leave. A message that nobody acknowledged yet would be lost with its publisher."""
        self._end("the gate ends")
        self._commands.stop(self.get_clock().now().to_msg())
        self._plan_out.wait_for_all_acked(Duration(seconds=LAST_STOP))
        self._commands.out.wait_for_all_acked(Duration(seconds=LAST_STOP))
        self.destroy_node()
