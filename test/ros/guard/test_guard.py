"""The guard in its own process beside a monitor: what passes, and that it stops without answers and says why."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from geometry_msgs.msg import PoseStamped, Twist, TwistStamped
from nav_msgs.msg import Odometry
from rclpy.qos import DurabilityPolicy, QoSProfile
from std_msgs.msg import String

from collision_monitor import records
from collision_monitor.objects.description import ObjectDescription
from collision_monitor.shapes.registry import Cylinder

RULES = Path(__file__).parents[3] / "config/guard_rules.yaml"
PROGRAM = "import sys; from collision_monitor.ros.executables import guard; sys.exit(guard())"


@pytest.fixture
def guard(ros_domain_id):
    started = []

    def start_guard(*arguments):
        command = [sys.executable, "-c", PROGRAM, "--ros-args", *(each for a in arguments for each in ("-p", a))]
        process = subprocess.Popen(command, stderr=subprocess.PIPE, text=True, env=dict(os.environ))
        started.append(process)
        return process

    yield start_guard
    for process in started:
        process.kill()
        process.communicate()


class Base:
    """A planner and a base: sends commands and keeps what the guard passes, and what it says."""

    def __init__(self, team, kind=Twist):
        self.team, self.kind, self.passed, self.said = team, kind, [], []
        self._out = team.node.create_publisher(kind, "/cmd_vel_in", 1)
        team.node.create_subscription(kind, "/cmd_vel_out", self.passed.append, 10)
        latched = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
        team.node.create_subscription(String, "/guard/state", lambda m: self.said.append(m.data), latched)

    def send(self, x):
        message = self.kind()
        (message.twist if self.kind is TwistStamped else message).linear.x = x
        self._out.publish(message)

    def last(self):
        message = self.passed[-1]
        return (message.twist if self.kind is TwistStamped else message).linear.x

    def hears(self, words):
        """Say whether the guard's newest state, if one has arrived, contains these words."""
        return bool(self.said) and words in self.said[-1]

    def drive(self, x, condition, states=None, timeout=30.0):
        """Send commands, and states if there are any, until the condition holds."""

        def look():
            self.send(x)
            if states is not None:
                self.team.say(*states)
            self.team.listen(0.03)
            return condition()

        self.team.until(look, timeout)


def row(object_id, x):
    state = np.zeros((), records.STATE)
    state["id"], state["quaternion"], state["position"] = object_id, (0, 0, 0, 1), (x, 0, 0)
    return state


@pytest.mark.parametrize("kind", [Twist, TwistStamped])
def test_commands_pass_and_stop_at_an_obstacle_and_without_answers(start, team, guard, kind):
    base = Base(team, kind)
    process = guard("robot:=robot_1", f"stamped:={'true' if kind is TwistStamped else 'false'}", "max_age:=1.0")
    base.drive(0.4, lambda: base.passed and base.hears("no status of object_monitor: does the monitor run?"))
    assert base.last() == 0.0
    monitor = start("run", "--rules", str(RULES))
    team.meet()
    team.describe(
        ObjectDescription(1, Cylinder(0.3, 1), name="robot_1"), ObjectDescription(2, Cylinder(0.25, 1), name="person")
    )
    team.status(lambda s: s.objects == 2)
    base.drive(0.4, lambda: base.last() == 0.4, [row(1, 0.0), row(2, 9.0)])
    base.drive(0.4, lambda: base.last() == 0.0, [row(1, 0.0), row(2, 0.8)])
    team.until(lambda: base.hears("stops: critical: robot_1 and person: distance"))
    base.drive(-0.4, lambda: base.last() == -0.4, [row(1, 0.0), row(2, 0.8)])  # it may retreat
    base.drive(0.4, lambda: base.last() == 0.4, [row(1, 0.0), row(2, 9.0)])
    base.drive(0.4, lambda: base.last() == 0.0)  # no more states
    team.until(lambda: base.hears("stops: no step of object_monitor for 1."))
    base.drive(0.4, lambda: base.last() == 0.4, [row(1, 0.0), row(2, 9.0)])
    monitor.kill()
    base.drive(0.4, lambda: base.last() == 0.0)
    base.passed.clear()
    team.listen(1.5)  # without commands there is one stop, and then nothing
    assert base.last() == 0.0
    count = len(base.passed)
    team.listen(0.5)
    assert len(base.passed) == count
    process.send_signal(signal.SIGINT)
    assert process.wait(10.0) == 0


SOURCES = """\
frame: map
rate: 20
objects:
  robot_1: {topic: /odom, shape: {cylinder: [0.3, 1.0]}}
  person: {topic: /person, shape: {cylinder: [0.25, 1.0]}}
"""


def test_objects_of_a_sources_file_are_guarded_too(start, team, guard, tmp_path):
    (tmp_path / "sources.yaml").write_text(SOURCES)
    base = Base(team)
    guard("robot:=robot_1", "max_age:=1.0")
    start("run", "--rules", str(RULES), "--sources", "sources.yaml")
    odometry = team.node.create_publisher(Odometry, "/odom", 10)
    person = team.node.create_publisher(PoseStamped, "/person", 10)

    def drive(distance, speed):
        """Send commands until this one passes, with the person at a distance before the robot."""

        def look():
            here, there = Odometry(child_frame_id="base"), PoseStamped()
            for message in (here, there):
                message.header.stamp, message.header.frame_id = team.node.get_clock().now().to_msg(), "map"
            here.pose.pose.orientation.w = there.pose.orientation.w = 1.0
            there.pose.position.x = distance
            odometry.publish(here)
            person.publish(there)
            base.send(0.4)
            team.listen(0.03)
            return base.passed and base.last() == speed

        team.until(look, 60.0)

    drive(9.0, 0.4)
    drive(0.8, 0.0)
    team.until(lambda: base.hears("stops: critical: robot_1 and person: distance"))
    drive(9.0, 0.4)


def test_a_monitor_without_rules_stops_the_robot(start, team, guard):
    base = Base(team)
    guard("robot:=robot_1", "max_age:=1.0")
    start("run")
    team.meet()
    team.describe(ObjectDescription(1, Cylinder(0.3, 1), name="robot_1"))
    team.status(lambda s: s.objects == 1)
    base.drive(0.4, lambda: base.hears("no alerts of object_monitor: has it rules?"), [row(1, 0.0)])
    base.drive(0.4, lambda: base.passed and base.last() == 0.0, [row(1, 0.0)])


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ([], "parameter robot: expected the name of the robot's object"),
        (["robot:=r", "max_age:=0.0"], "parameter max_age: expected 0.001 to 1000, got 0"),
        (["robot:=r", "caution_factor:=2.0"], "parameter caution_factor: expected 0 to 1, got 2"),
        (["robto:=r"], "parameter 'robto' is unknown: did you mean 'robot'?"),
    ],
)
def test_impossible_parameters_are_refused(guard, given, said):
    process = guard(*given)
    _, words = process.communicate(timeout=60.0)
    assert process.returncode == 2
    assert said in words
