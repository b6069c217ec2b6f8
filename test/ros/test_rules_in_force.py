"""The rules in force on their topic and on the command line, with whom they cover at this moment."""

from __future__ import annotations

import subprocess
import sys

from diagnostic_msgs.msg import DiagnosticArray
from rclpy.qos import DurabilityPolicy, QoSProfile
from std_msgs.msg import String

from collision_monitor.codec import Removal
from collision_monitor.objects.description import ObjectDescription
from collision_monitor.shapes.registry import Cylinder
from test.ros.guard.conftest import RULES, row


def listed(*arguments):
    command = [sys.executable, "-m", "collision_monitor", "rules", *arguments]
    done = subprocess.run(command, capture_output=True, text=True, timeout=60.0)
    return done.returncode, done.stdout, done.stderr


def test_rules_in_force_follow_the_objects_and_the_rules(start, team):
    latched = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
    heard = []
    team.node.create_subscription(DiagnosticArray, "/object_monitor/rules_in_force", heard.append, latched)
    rules = team.node.create_publisher(String, "/object_monitor/rules", latched)
    start("run", "--rules", str(RULES))
    team.meet()

    def hears(level, text):
        """Publish states until the newest array says so of its only rule."""

        def look():
            team.say(row(1, 0.0), row(2, 9.0))
            team.listen(0.05)
            status = heard[-1].status[0] if heard else None
            return status is not None and status.level == level and status.message == text

        team.until(look)

    hears(b"\x01", "covers nobody")
    assert heard[-1].status[0].name == "object_monitor: guard"
    team.describe(
        ObjectDescription(1, Cylinder(0.3, 1), name="robot_1"), ObjectDescription(2, Cylinder(0.25, 1), name="wall")
    )
    hears(b"\x00", "covers robot_1 against every other object")
    values = {each.key: each.value for each in heard[-1].status[0].values}
    assert (values["between"], values["caution"]) == ("robot and any", "distance at most 2.5 m")
    code, text, _ = listed("--live")
    assert code == 0, text
    assert "guard:\n  between              robot and any\n" in text
    assert "  covers               robot_1 against every other object\n" in text
    team.describe(Removal(1))
    hears(b"\x01", "covers nobody")
    code, text, error = listed("--live")
    assert (code, "covers               nobody" in text) == (3, True)
    assert "rule 'guard' covers nobody" in error
    rules.publish(String(data="rules: {}\n"))
    hears(b"\x01", "no rules are in force: nothing raises an alert")
    assert listed("--live")[:2] == (3, "no rules are in force: nothing raises an alert\n")


def test_a_file_is_checked_and_listed_without_ros(tmp_path):
    code, text, _ = listed(str(RULES))
    assert (code, text.splitlines()[:2]) == (0, ["guard:", "  between              robot and any"])
    (tmp_path / "bad.yaml").write_text("rules: {a: {between: [robot, any]}}")
    code, _, error = listed(str(tmp_path / "bad.yaml"))
    assert (code, "line 1" in error) == (2, True)
    for arguments in ([], ["--live", str(RULES)], [str(RULES), "--timeout", "3"], ["--live", "--monitor", "a b"]):
        assert listed(*arguments)[0] == 2


def test_no_monitor_is_an_error(ros_domain_id):
    code, _, error = listed("--live", "--timeout", "1")
    assert (code, "no monitor /object_monitor published its rules in 1 s: does it run?" in error) == (1, True)
