"""The guard in its own process beside a monitor: what passes, and that it stops without answers and says why."""

from __future__ import annotations

import signal

import pytest
from geometry_msgs.msg import PoseStamped, Twist, TwistStamped
from nav_msgs.msg import Odometry

from collision_monitor.objects.description import ObjectDescription
from collision_monitor.ros import executables
from collision_monitor.shapes.registry import Cylinder
from test.ros.guard.conftest import RULES, Base, row


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

    def quiet():
        count = len(base.passed)
        team.listen(0.5)
        return count and len(base.passed) == count

    team.until(quiet)  # without commands there is one stop, and then nothing
    assert base.last() == 0.0
    process.send_signal(signal.SIGINT)
    assert process.wait(10.0) == 0


SOURCES = """\
frame: map
rate: 20
objects:
  robot_1: {topic: /odom, shape: {cylinder: [0.3, 1.0]}}
  person: {topic: /person, shape: {cylinder: [0.25, 1.0]}}
"""


def test_objects_of_a_sources_file_are_guarded_too(start, team, base, guard, tmp_path):
    (tmp_path / "sources.yaml").write_text(SOURCES)
    guard("robot:=robot_1", "max_age:=1.0")
    start("run", "--rules", str(RULES), "--sources", "sources.yaml")
    odometry = team.node.create_publisher(Odometry, "/odom", 10)
    person = team.node.create_publisher(PoseStamped, "/person", 10)

    def drive(distance, speed, words="", timeout=60.0):
        """Send commands until this one passes, with the person at a distance before the robot, or missing."""

        def send():
            here, there = Odometry(child_frame_id="base"), PoseStamped()
            for message in (here, there):
                message.header.stamp, message.header.frame_id = team.node.get_clock().now().to_msg(), "map"
            here.pose.pose.orientation.w = there.pose.orientation.w = 1.0
            odometry.publish(here)
            if distance is not None:
                there.pose.position.x = distance
                person.publish(there)
            base.send(0.4)

        base.drive_by(send, lambda: base.passed and base.last() == speed and base.hears(words), None, timeout)

    drive(None, 0.0, "not monitored, though the rules name it: person: no message on /person yet")
    drive(9.0, 0.4)
    drive(0.8, 0.0, "stops: critical: robot_1 and person: distance")
    drive(9.0, 0.4)
    drive(None, 0.0, "'person': no usable new state for 1.")


def test_a_monitor_without_rules_stops_the_robot(start, team, base, guard):
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
        (["robot:=[]"], "parameters: expected a value with a type for each, got an empty list"),
        (["robot:=' , '"], "parameter robot: expected the name of the robot's object"),
        (["robot:=7"], "parameter robot: expected a text or a list of texts, got 7"),
        (["robot:=arm/*"], "parameter base: expected the name of the object whose frame the commands have"),
        (["robot:=r", "max_age:=0.0"], "parameter max_age: expected 0.001 to 1000, got 0"),
        (["robot:=r", "obstacle_timeout:=.nan"], "parameter obstacle_timeout: expected 0.001 to 1000, got nan"),
        (["robot:=r", "caution_factor:=2.0"], "parameter caution_factor: expected 0 to 1, got 2"),
        (["robto:=r"], "parameter 'robto' is unknown: did you mean 'robot'?"),
    ],
)
def test_impossible_parameters_are_refused(ros_domain_id, signals, capfd, given, said):
    assert executables.guard(["guard", "--ros-args", *(word for each in given for word in ("-p", each))]) == 2
    assert said in capfd.readouterr().err


def test_a_process_without_parameters_is_refused(guard, tmp_path):
    assert guard().wait(60.0) == 2
    assert "parameter robot: expected the name of the robot's object" in (tmp_path / "guard_0.txt").read_text()
