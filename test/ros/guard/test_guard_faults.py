"""The guard beside real monitors that do not cover the robot, are late, are two or restart, and beside bad commands."""

from __future__ import annotations

import math
import signal
import subprocess
import sys
import time

import pytest
from rclpy.qos import DurabilityPolicy, QoSProfile
from std_msgs.msg import String

from collision_monitor.codec import encode_descriptions
from collision_monitor.objects.description import ObjectDescription
from collision_monitor.pipeline.topics import Topic
from collision_monitor.ros.endpoints import quality_of
from collision_monitor.ros.guard.velocity_commands import COMPONENTS, twist_of
from collision_monitor.shapes.registry import Cylinder, Sphere
from collision_monitor_msgs.msg import ObjectDescriptionArray, ObjectStateArray
from test.ros.guard.conftest import RULES, row

ROBOT = ObjectDescription(1, Cylinder(0.3, 1), name="turtlebot")
WALL = ObjectDescription(2, Cylinder(0.25, 1), name="wall")
NAMED = RULES.read_text().replace('"robot*"', '"turtle*", "six/*"')
FAR = [row(1, 0.0), row(2, 9.0)]


def test_a_robot_that_no_rule_covers_stands_until_one_does(start, team, base, guard):
    guard("robot:=turtlebot", "max_age:=1.0")
    monitor = start("run", "--rules", str(RULES))
    latched = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
    rules = team.node.create_publisher(String, "/object_monitor/rules", latched)
    team.meet()
    team.describe(ROBOT, WALL)
    team.status(lambda s: s.objects == 2)
    base.drive(0.8, lambda: base.hears("no rule in force covers 'turtlebot' now; the rules are 'guard'"), FAR)
    base.drive(0.8, lambda: base.passed and base.last() == 0.0, FAR)
    (worst,) = {each.level for each in base.health[-2:]}
    assert (worst, "no rule in force covers 'turtlebot'" in base.health[-1].message) == (b"\x02", True)
    base.drive(0.8, lambda: "rules: no object belongs to the class robot" in monitor.words, FAR)
    rules.publish(String(data=NAMED))
    base.drive(0.8, lambda: base.last() == 0.8 and base.hears("passes; guards turtlebot"), FAR)
    base.drive(0.8, lambda: base.health[-1].level == b"\x00", FAR)
    rules.publish(String(data="rules: {}\n"))
    base.drive(0.8, lambda: base.last() == 0.0 and base.hears("has it rules? None is in force"), FAR)
    rules.publish(String(data=NAMED))
    base.drive(0.8, lambda: base.last() == 0.8, FAR)
    # 2.5 m is what the rules see, of which 0.2 m stay free. If the next answer fails to come, the robot drives on for
    # max_age (1 s) and then brakes with 1 m/s^2: v + v^2 / 2 = 2.3 m
    base.drive(3.0, lambda: 1.3 < base.last() <= math.sqrt(1.0 + 2.0 * 2.3) - 1.0, FAR)
    team.until(lambda: base.hears("slows down: what the rules see ahead allows 1.37 m/s"))


LISTENER = """
import rclpy
from geometry_msgs.msg import TwistStamped
rclpy.init()
node = rclpy.create_node("listener")
node.create_subscription(TwistStamped, "/cmd_vel_out", lambda m: print(m.twist.linear.x, flush=True), 10)
rclpy.spin(node)
"""


@pytest.fixture
def slow_base(ros_domain_id, tmp_path):
    """A base in a process of its own, and the speeds (m/s) that it has received."""
    speeds = tmp_path / "speeds"
    with speeds.open("w") as out, subprocess.Popen([sys.executable, "-c", LISTENER], stdout=out) as process:
        yield process, lambda: [float(line) for line in speeds.read_text().splitlines()]
        process.kill()


def test_commands_that_are_not_finite_or_of_another_time_stop(start, team, stamped_base, slow_base, guard, tmp_path):
    base, (slow, received) = stamped_base, slow_base
    (tmp_path / "rules.yaml").write_text(NAMED)
    process = guard("robot:=turtlebot", "max_age:=1.0", "stamped:=true")
    start("run", "--rules", "rules.yaml")
    team.meet()
    team.describe(ROBOT, WALL)
    team.status(lambda s: s.objects == 2)
    base.drive(0.5, lambda: base.passed and base.last() == 0.5, FAR)
    for k, (part, axis) in enumerate(COMPONENTS):
        bad = base.command(0.5)
        setattr(getattr(bad.twist, part), axis, (math.nan, math.inf, -math.inf)[k % 3])
        base.drive_by(
            lambda bad=bad: base.publish(bad),
            lambda part=part, axis=axis: base.hears(f"not finite: {part}.{axis}") and base.last() == 0.0,
            FAR,
        )
        assert all(
            math.isfinite(getattr(getattr(twist_of(message), p), a)) for message in base.passed for p, a in COMPONENTS
        )
        base.drive(0.5, lambda: base.last() == 0.5, FAR)
    for ahead, words in ((-0.8, "s old by its stamp"), (30.0, "from the future"), (-1.7e9, "days old by its stamp")):
        base.drive_by(
            lambda ahead=ahead: base.publish(base.command(0.5, ahead)),
            lambda words=words: base.last() == 0.0 and base.hears(words),
            FAR,
        )
    given = base.command(0.5)
    base.passed.clear()
    base.drive_by(lambda: base.publish(given), lambda: base.passed and base.last() == 0.5, FAR)
    assert base.passed[-1].header == given.header
    base.drive(0.5, lambda: base.last() == 0.5 and received()[-1:] == [0.5], FAR)
    slow.send_signal(signal.SIGSTOP)
    base.drive(0.5, lambda: base.last() == 0.5, FAR)
    process.send_signal(signal.SIGINT)  # its last word is a stop, also for a base that takes no messages at the moment
    time.sleep(0.3)
    slow.send_signal(signal.SIGCONT)
    assert process.wait(10.0) == 0
    team.until(lambda: base.last() == 0.0 and received()[-1] == 0.0)


def test_late_states_stop_the_robot(start, team, base, guard, tmp_path):
    """Of all objects: the answers are late. They arrive steadily, so their arrival shows nothing."""
    (tmp_path / "rules.yaml").write_text(NAMED)
    guard("robot:=turtlebot", "max_age:=1.0")
    start("run", "--rules", "rules.yaml")
    team.meet()
    team.describe(ROBOT, WALL)
    team.status(lambda s: s.objects == 2)

    def late():
        team.say(*FAR, stamp=team.now - 5_000_000_000)
        base.send(0.5)

    base.drive_by(late, lambda: base.hears("the answers of object_monitor are 5.") and base.passed)
    assert all(message.linear.x == 0.0 for message in base.passed)
    base.drive(0.5, lambda: base.last() == 0.5, FAR, 60.0)


def test_several_objects_with_wildcards_are_guarded_and_named(start, team, base, guard, tmp_path):
    (tmp_path / "rules.yaml").write_text(NAMED)
    tool = ObjectDescription(7, Sphere(0.1), name="six/tool", allowed=(1,))
    arm = ObjectDescription(8, Sphere(0.1), name="six/arm", allowed=(1, 7))
    guard("robot:='turtlebot, six/*'", "max_age:=1.0")
    start("run", "--rules", "rules.yaml")
    team.meet()
    team.describe(ROBOT, WALL, tool, arm)
    team.status(lambda s: s.objects == 4)
    away = [*FAR, row(7, 0.0, 1.0), row(8, 0.0, 0.6)]
    base.drive(0.5, lambda: base.hears("passes; guards turtlebot, six/tool, six/arm") and base.last() == 0.5, away)
    near = [row(1, 0.0), row(2, 0.6, 1.0), *away[2:]]  # only the tool is near the wall
    base.drive(0.5, lambda: base.last() == 0.0 and base.hears("critical: wall and six/tool"), near)
    base.drive(0.5, lambda: base.last() == 0.5, away)
    base.drive(0.5, lambda: base.last() == 0.0 and base.hears("no state of 'six/arm' for"), away[:3])
    base.drive(0.5, lambda: base.last() == 0.5, away)
    base.drive(0.5, lambda: base.last() == 0.0 and base.hears("'wall': no usable new state for"), [away[0], *away[2:]])
    base.drive(0.5, lambda: base.last() == 0.5, away)


def test_a_second_monitor_and_a_restarted_one_stop_the_robot(start, team, base, guard, tmp_path):
    (tmp_path / "rules.yaml").write_text(NAMED)
    guard("robot:=turtlebot", "max_age:=1.0")
    first = start("run", "--rules", "rules.yaml")
    team.meet()
    team.describe(ROBOT, WALL)
    team.status(lambda s: s.objects == 2)
    base.drive(0.5, lambda: base.passed and base.last() == 0.5, FAR)
    second = start("run")  # the same name, and no rules
    base.drive(0.5, lambda: base.last() == 0.0 and base.hears("2 monitors answer as object_monitor"), FAR, 60.0)
    second.stop()
    base.drive(0.5, lambda: base.last() == 0.5, FAR)
    first.kill()
    base.drive(0.5, lambda: base.last() == 0.0, FAR)
    start("run", "--rules", "rules.yaml")
    shapes = encode_descriptions(team.now, "world", [ROBOT, WALL])

    def send():
        team.publish_shapes(shapes)
        base.send(0.5)

    base.drive_by(send, lambda: base.last() == 0.5, FAR, 60.0)


def test_the_monitor_of_another_namespace_is_none_of_ours(start, team, base, guard, tmp_path):
    """Its answers cover a robot of the same name, in another hall."""
    (tmp_path / "rules.yaml").write_text(NAMED)
    guard("robot:=turtlebot", "max_age:=1.0")
    start("run", "--rules", "rules.yaml", "--ros-args", "-r", "__ns:=/hall_2")
    shapes = team.node.create_publisher(
        ObjectDescriptionArray, "/hall_2/object_monitor/objects/shapes", quality_of(Topic.SHAPES)
    )
    states = team.node.create_publisher(
        ObjectStateArray, "/hall_2/object_monitor/objects/states", quality_of(Topic.STATES)
    )
    team.until(lambda: shapes.get_subscription_count() and states.get_subscription_count(), 60.0)
    shapes.publish(encode_descriptions(team.now, "world", [ROBOT, WALL]))
    base.drive(0.5, lambda: base.hears("no status of object_monitor") and len(base.passed) > 30)
    assert {message.linear.x for message in base.passed} == {0.0}


@pytest.mark.parametrize("silent", [True, False])
def test_a_flood_of_commands_does_not_delay_a_stop(start, team, base, guard, tmp_path, silent):
    (tmp_path / "rules.yaml").write_text(NAMED)
    guard("robot:=turtlebot", "max_age:=0.5")
    start("run", "--rules", "rules.yaml")
    team.meet()
    team.describe(ROBOT, WALL)
    team.status(lambda s: s.objects == 2)

    def flood():
        for _ in range(100):
            base.send(0.5)

    base.drive_by(flood, lambda: base.passed and base.last() == 0.5, FAR)
    base.drive_by(flood, lambda: base.last() == 0.0, None if silent else [row(1, 0.0), row(2, 0.8)], 15.0)
