"""The gate in its own process beside a monitor: what goes through, what stops, and what the service answers."""

from __future__ import annotations

import signal
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from geometry_msgs.msg import PoseStamped, Twist
from joint_controller import JointController
from nav_msgs.msg import Path as PathMessage
from rclpy.qos import DurabilityPolicy, QoSProfile
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64, String
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

import collision_monitor as cm
from collision_monitor import records
from collision_monitor.objects.description import ObjectDescription
from collision_monitor.ros import executables
from collision_monitor.ros.gate.gate_options import NAMES, gate_help
from collision_monitor.shapes.registry import Cylinder, Sphere
from collision_monitor_msgs.srv import CheckTrajectory

URDF = Path(__file__).parents[3] / "examples/arm/arm.urdf"
JOINTS = [*(f"joint_{k}" for k in range(1, 8)), "finger_joint"]
PLACE = np.array([0.0, 0.2, 0.0, -2.0, 0.0, 2.2, 0.785, 0.01])
SWUNG = np.array([1.5, 0.2, 0.0, -2.0, 0.0, 2.2, 0.785, 0.01])
SOURCES = f"""\
frame: world
rate: 40
objects:
  post: {{topic: /post, shape: {{cylinder: [0.05, 2.0]}}}}
robots:
  arm: {{urdf: {URDF}, joint_states: /joint_states, base: {{pose: [0, 0, 0]}}, allowed: {{}}}}
"""


def swing(goal: Any = SWUNG, seconds: float = 3.0) -> JointTrajectory:
    point = JointTrajectoryPoint(positions=list(map(float, goal)), velocities=[0.0] * 8)
    point.time_from_start.sec, point.time_from_start.nanosec = int(seconds), round(seconds % 1 * 1e9)
    return JointTrajectory(joint_names=JOINTS, points=[point])


class Cell:
    """An arm with its controller, and a post."""

    def __init__(self, team: Any) -> None:
        self.team, self.controller = team, JointController(JOINTS, PLACE)
        self.robot = cm.Robot(URDF)
        self.post = (9.0, 0.0, 0.5)
        self.said: list[str] = []
        self.scales: list[float] = []
        self.sent: list[Any] = []
        node, latched = team.node, QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
        self._joints = node.create_publisher(JointState, "/joint_states", 10)
        self._post = node.create_publisher(PoseStamped, "/post", 10)
        self.plan_out = node.create_publisher(JointTrajectory, "/joint_trajectory_in", 10)
        node.create_subscription(JointTrajectory, "/joint_trajectory_out", self._on_plan, 10)
        node.create_subscription(String, "/gate/state", lambda m: self.said.append(m.data), latched)
        node.create_subscription(Float64, "/gate/speed_scale", lambda m: self.scales.append(m.data), latched)
        self.check = node.create_client(CheckTrajectory, "/gate/check_trajectory")

    def _on_plan(self, message: Any) -> None:
        self.sent.append(message)
        self.controller.take(message, time.monotonic())

    @property
    def q(self) -> Any:
        return self.controller.at(time.monotonic())[0]

    def hand(self, q: Any) -> Any:
        poses = self.robot.states(np.stack([q, np.zeros(8)], axis=1), np.eye(1, 13, 6)[0])[0]
        return poses[self.robot.tree.links.index("hand"), :3]

    def live(self, condition: Callable[[], Any], timeout: float = 60.0) -> None:
        """Publish joints and post at 40 Hz until the condition holds."""

        def look() -> Any:
            q, qd = self.controller.at(time.monotonic())
            message = JointState(name=JOINTS, position=q.tolist(), velocity=qd.tolist())
            pose = PoseStamped()
            for each in (message, pose):
                each.header.stamp = self.team.node.get_clock().now().to_msg()
            pose.header.frame_id = "world"
            pose.pose.position.x, pose.pose.position.y, pose.pose.position.z = map(float, self.post)
            pose.pose.orientation.w = 1.0
            self._joints.publish(message)
            self._post.publish(pose)
            self.team.listen(0.02)
            return condition()

        try:
            self.team.until(look, timeout)
        except AssertionError:
            raise AssertionError(f"the gate said {self.said[-4:]}, and sent {len(self.sent)}") from None

    def hears(self, words: str) -> bool:
        return bool(self.said) and words in self.said[-1]

    def ask(self, **request: Any) -> Any:
        pending = self.check.call_async(CheckTrajectory.Request(**request))
        self.live(pending.done)
        return pending.result()


@pytest.fixture
def cell(start: Any, team: Any, gate: Any, tmp_path: Path) -> Cell:
    """A cell whose gate is ready. The monitor has priority over compilers of other tests."""
    (tmp_path / "sources.yaml").write_text(SOURCES)
    start("run", "--sources", "sources.yaml", "--ros-args", "-p", "frame_id:=world")
    made = Cell(team)
    made.process = gate("robot:=arm/*", "base:=arm/base", f"urdf:={URDF}", "max_age:=1.0", "time_tolerance:=1.0")  # type: ignore[attr-defined]
    made.live(lambda: made.hears("no plan"))
    made.live(made.check.service_is_ready)
    return made


def test_a_plan_goes_through_to_the_controller_and_to_its_end(cell: Cell) -> None:
    cell.plan_out.publish(swing())
    cell.live(lambda: cell.hears("passes"))
    assert len(cell.sent) == 1 and cell.sent[0] == swing()
    cell.live(lambda: np.abs(cell.q - SWUNG).max() < 1e-6)
    cell.live(lambda: cell.hears("no plan"))
    assert 0.0 in cell.scales and 1.0 in cell.scales and len(cell.sent) == 1


def test_a_plan_into_a_post_does_not_go_through(cell: Cell) -> None:
    at = cell.hand((PLACE + SWUNG) / 2)
    cell.post = (at[0], at[1], 0.5)
    cell.live(lambda: cell.ask(trajectory=swing()).conflicts)
    cell.plan_out.publish(swing())
    cell.live(lambda: cell.hears("refused a plan: arm/"))
    assert "and post: 0.0" in cell.said[-1] and "s of the plan" in cell.said[-1] and not cell.sent
    answer = cell.ask(trajectory=swing())
    assert answer.judged and not answer.clear and answer.conflicts[0].other == "post"
    assert 0.5 < answer.clear_until == answer.conflicts[0].entry_lower < 1.5
    assert answer.conflicts[0].exit_upper < 3.0 and answer.least_distance == 0.0
    cell.post = (0.9, 0.9, 0.5)
    cell.live(lambda: cell.ask(trajectory=swing()).clear)
    assert 0.05 < cell.ask(trajectory=swing()).least_distance < 1.0 and not cell.sent
    other = JointTrajectory(joint_names=["door"], points=[JointTrajectoryPoint(positions=[1.0])])
    answer = cell.ask(trajectory=other)
    assert not answer.judged and "got 'door'" in answer.reason and not answer.clear


def test_a_post_that_appears_stops_the_arm_and_it_goes_on_when_it_is_gone(cell: Cell) -> None:
    at = cell.hand((PLACE + SWUNG) / 2)
    cell.plan_out.publish(swing())
    cell.live(lambda: cell.q[0] > 0.05)
    cell.post = (at[0], at[1], 0.5)
    cell.live(lambda: cell.hears("stops: arm/"))
    last: list[float] = []

    def stands() -> bool:
        last.append(float(cell.q[0]))
        return len(last) > 20 and last[-1] == last[-20]

    cell.live(stands)
    assert 0.05 < last[-1] < 0.75 and "and post" in cell.said[-1] and "of 3.00 s of the plan" in cell.said[-1]
    cell.post = (9.0, 0.0, 0.5)
    cell.live(lambda: np.abs(cell.q - SWUNG).max() < 1e-6)


def test_a_new_plan_takes_the_place_of_the_one_before_and_an_empty_one_ends_it(cell: Cell) -> None:
    cell.plan_out.publish(swing())
    cell.live(lambda: cell.q[0] > 0.2)
    cell.plan_out.publish(swing(PLACE, 2.0))
    cell.live(lambda: np.abs(cell.q - PLACE).max() < 1e-6)
    cell.live(lambda: cell.hears("no plan"))
    cell.plan_out.publish(swing())
    cell.live(lambda: cell.q[0] > 0.2)
    cell.plan_out.publish(JointTrajectory())
    cell.live(lambda: cell.hears("the planner ended the plan"))
    where = cell.q[0]
    cell.live(lambda: abs(cell.q[0] - where) > 1.0 or (time.monotonic() > 0 and len(cell.sent) > 3))
    assert cell.q[0] < 1.0


def test_a_controller_that_never_starts_is_noticed(cell: Cell) -> None:
    cell.controller.delay = 1e9
    cell.plan_out.publish(swing())
    cell.live(lambda: cell.hears("the controller has not started"))
    (point,) = cell.sent[-1].points  # it is told to hold its place
    np.testing.assert_allclose(point.positions, PLACE, atol=1e-9)
    assert not np.array(point.velocities).any()


def test_without_a_monitor_it_stops_the_arm(cell: Cell, start: Any) -> None:
    cell.plan_out.publish(swing(seconds=6.0))
    cell.live(lambda: cell.q[0] > 0.1)
    count = len(cell.sent)
    begun = time.monotonic()

    def silent() -> bool:  # no states, so that the monitor makes no step
        cell.team.listen(0.05)
        return len(cell.sent) > count

    cell.team.until(silent, 10.0)
    assert time.monotonic() - begun < 3.0
    assert cell.hears("stops") or cell.team.until(lambda: cell.hears("stops"), 5.0) is None
    assert not np.array(cell.sent[-1].points[-1].velocities).any()


def test_it_ends_with_a_stop(cell: Cell) -> None:
    cell.plan_out.publish(swing(seconds=6.0))
    cell.live(lambda: cell.q[0] > 0.1)
    count = len(cell.sent)
    cell.process.send_signal(signal.SIGINT)  # type: ignore[attr-defined]
    cell.live(lambda: len(cell.sent) > count)
    assert cell.process.wait(10.0) == 0  # type: ignore[attr-defined]


def test_a_base_follows_its_path_and_stops_for_a_person(start: Any, team: Any, gate: Any) -> None:
    gate("robot:=cart,load", "speed:=0.5", "max_age:=1.0", "tolerance:=0.3")
    start("run", "--ros-args", "-p", "frame_id:=world")
    team.meet()
    team.describe(
        ObjectDescription(1, Cylinder(0.3, 0.4), name="cart", allowed=(2,)),
        ObjectDescription(2, Sphere(0.2), name="load", allowed=(1,)),
        ObjectDescription(3, Cylinder(0.2, 1.0), name="person"),
    )
    said: list[str] = []
    passed: list[float] = []
    paths: list[Any] = []
    latched = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
    team.node.create_subscription(String, "/gate/state", lambda m: said.append(m.data), latched)
    team.node.create_subscription(Twist, "/cmd_vel_out", lambda m: passed.append(m.linear.x), 10)
    team.node.create_subscription(PathMessage, "/path_out", paths.append, 10)
    path_out, command_out = (
        team.node.create_publisher(k, t, 1) for k, t in ((PathMessage, "/path_in"), (Twist, "/cmd_vel_in"))
    )
    place, person, begun = [0.0], [9.0], [time.monotonic()]

    def row(object_id: int, x: float, z: float = 0.0) -> Any:
        state = np.zeros((), records.STATE)
        state["id"], state["quaternion"], state["position"] = object_id, (0, 0, 0, 1), (x, 0, z)
        return state

    def drive(condition: Callable[[], Any], timeout: float = 60.0) -> None:
        def look() -> Any:
            now = time.monotonic()
            place[0] += (passed[-1] if passed else 0.0) * min(now - begun[0], 0.1)
            begun[0] = now
            team.say(row(1, place[0]), row(2, place[0], 0.6), row(3, person[0]))
            command = Twist()
            command.linear.x = 0.4
            command_out.publish(command)
            team.listen(0.03)
            return condition()

        try:
            team.until(look, timeout)
        except AssertionError:
            raise AssertionError(f"the gate said {said[-3:]}, passed {passed[-3:]}, cart at {place}") from None

    drive(lambda: said and "no plan" in said[-1] and passed and passed[-1] == 0.0)
    message = PathMessage()
    for k in range(80):
        pose = PoseStamped()
        pose.pose.position.x, pose.pose.orientation.w = 0.05 * k, 1.0
        message.poses.append(pose)
    path_out.publish(message)
    drive(lambda: place[0] > 0.5)
    assert paths and len(paths[0].poses) == 80 and passed[-1] == pytest.approx(0.4)
    person[0] = place[0] + 1.2
    drive(lambda: said and said[-1].startswith("stops: cart and person") and passed[-1] == 0.0)
    assert person[0] - place[0] > 0.5  # their radii
    person[0] = 9.0
    drive(lambda: place[0] > 2.0)


# -- without a monitor


@pytest.mark.parametrize(
    ("parameters", "text"),
    [
        ([], "parameter robot: expected the name of the robot's object, got an empty text"),
        (["robot:=arm/*"], "parameter base: expected the name of the object"),
        (["robot:=cart", "clearance:=-1.0"], "parameter clearance: expected 0 to 10, got -1"),
        (["robot:=cart", "urdf:=/nowhere.urdf"], "/nowhere.urdf"),
        (["robot:=cart", "urdf:=a", "urdf_topic:=b"], "expected `urdf` or `urdf_topic`, got both"),
        (["robot:=cart", "spede:=1.0"], "parameter 'spede' is unknown"),
        (["robot:=cart", f"urdf:={URDF}", "carrier:=tail"], "expected a link of the URDF, got 'tail'"),
    ],
)
def test_impossible_parameters_are_refused(parameters: list[str], text: str, ros_domain_id: int, capfd: Any) -> None:
    arguments = ["gate", "--ros-args", *(each for p in parameters for each in ("-p", p))]
    assert executables.gate(arguments) == executables.BAD_INPUT
    assert text in capfd.readouterr().err


def test_help_names_every_parameter(capsys: Any) -> None:
    assert executables.gate(["gate", "--help"]) == 0
    assert capsys.readouterr().out == gate_help()
    for name in NAMES:
        assert f"  {name} " in gate_help(), name
    assert max(map(len, gate_help().splitlines())) <= 130
