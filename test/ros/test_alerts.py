"""Alerts of the running node: published once for each change, changed at run time, recorded, and replayed."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np
import pytest
from rcl_interfaces.srv import SetParameters
from rclpy.parameter import Parameter
from rclpy.qos import DurabilityPolicy, QoSProfile
from std_msgs.msg import String

from collision_monitor import records
from collision_monitor.objects.description import ObjectDescription
from collision_monitor.pipeline.topics import Topic
from collision_monitor.ros.endpoints import quality_of
from collision_monitor.shapes.registry import Box, Sphere
from collision_monitor_msgs.msg import CollisionAlert, CollisionAlertArray

RULES = """\
classes: {cart: [cart], person: ["person_*"], nobody: ["nobody_*"]}
rules:
  near:
    between: [cart, person]
    caution: {distance: 2.0}
    critical: {distance: 0.5}
    quiet_at_rest: false
    quiet_when_parting: false
"""
LATCHED = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)


@pytest.fixture
def alerts(team):
    kept = []
    team.node.create_subscription(CollisionAlert, "/object_monitor/alerts", kept.append, quality_of(Topic.ALERTS))
    return kept


def row(object_id: int, x: float) -> np.void:
    state = np.zeros((), records.STATE)
    state["id"], state["quaternion"], state["position"] = object_id, (0, 0, 0, 1), (x, 0, 0)
    return state


def set_rules(team, value: str) -> SetParameters.Response:
    client = team.node.create_client(SetParameters, "/object_monitor/set_parameters")
    request = SetParameters.Request(parameters=[Parameter("rules", value=value).to_parameter_msg()])
    future = client.call_async(request)
    team.until(future.done)
    return future.result().results[0]


def describe(team) -> None:
    team.meet()
    team.describe(ObjectDescription(1, Box((1, 1, 1)), name="cart"), ObjectDescription(2, Sphere(0.5), name="person_1"))
    team.status(lambda s: s.objects == 2)


def test_the_first_rules_of_a_running_node_do_not_silence_it(start, team):
    """Their kernels are loaded at its start: with the first rules, that took 3 s of the processor."""
    process = start("run")
    describe(team)
    began = processor_time(process.pid)
    assert set_rules(team, RULES).successful
    assert processor_time(process.pid) - began < 1.0
    assert process.stop() == 0


def processor_time(pid: int) -> float:
    """s that the threads of a process have used."""
    fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def test_alerts_are_published_changed_at_run_time_recorded_and_replayed(start, team, alerts, tmp_path):
    (tmp_path / "rules.yaml").write_text(RULES)
    monitor = start("run", "--rules", "rules.yaml", "--record", "run.mcap")
    describe(team)
    for x in (9.0, 9.0, 2.5, 2.5, 1.2, 1.2, 1.2, 9.0):
        team.ask(row(1, 0.0), row(2, x))
    team.until(lambda: len(alerts) == 3)
    assert [(a.previous_level, a.level, a.number) for a in alerts] == [(0, 1, 1), (1, 3, 2), (3, 0, 3)]
    assert alerts[1].distance == pytest.approx(0.2)
    assert (alerts[1].rule, alerts[1].name_b, alerts[1].class_b) == ("near", "person_1", "person")

    team.ask(row(1, 0.0), row(2, 2.5))
    raised = []
    quality = quality_of(Topic.RAISED_ALERTS)
    team.node.create_subscription(CollisionAlertArray, "/object_monitor/raised_alerts", raised.append, quality)
    team.until(lambda: raised and raised[-1].highest == 1)  # a late subscriber gets it
    assert [each.id_b for each in raised[-1].alerts] == [2]

    wider = RULES.replace("0.5", "1.8")
    team.node.create_publisher(String, "/object_monitor/rules", LATCHED).publish(String(data=wider))
    team.until(lambda: "rules of the alerts changed" in monitor.words)
    team.ask(row(1, 0.0), row(2, 2.5))
    team.until(lambda: alerts[-1].level == 3)

    refused = set_rules(team, RULES.replace("cart, person]", "cart, perso]"))
    assert not refused.successful
    assert "line 4, rules, near, between, 1: the class 'perso' is unknown: did you mean 'person'?" in refused.reason
    assert set_rules(team, "").successful
    team.ask(row(1, 0.0), row(2, 2.5))
    team.until(lambda: alerts[-1].cause == CollisionAlert.REMOVED)
    assert [a.number for a in alerts] == [1, 2, 3, 4, 5, 6]
    assert monitor.stop() == 0

    replay = start("replay", "run.mcap")
    assert replay.wait() == 0, replay.words
    expected = "expect:\n- alert: [cart, person_1]\n  level: critical\n  rule: near\n- no_alert: [cart, cart]\n"
    (tmp_path / "expect.yaml").write_text(f"{expected}- replay: identical\n")
    check = start("check", "run.mcap", "--expect", "expect.yaml")
    assert check.wait() == 0, check.words


def test_rules_that_cannot_be_used_stop_the_node_at_its_start(start, tmp_path):
    (tmp_path / "rules.yaml").write_text(RULES.replace("distance: 0.5", "distance: 5"))
    monitor = start("run", "--rules", "rules.yaml")
    assert monitor.wait() == 2
    assert "rules.yaml, line 6, rules, near, critical, distance: expected at most 2" in monitor.words
