"""Plans of other programs over DDS: a path and a schedule give the node the bytes that they give without ROS."""

from __future__ import annotations

import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

from foreign_bag import SECOND, START, STORE, odometry
from foreign_messages import decoder
from foreign_plans import path
from nav_msgs.msg import Odometry
from nav_msgs.msg import Path as PathMessage

from collision_monitor.codec import decode_trajectories
from collision_monitor.pipeline.topics import Topic
from collision_monitor.records import PlanFlag
from collision_monitor.ros.endpoints import subscription
from collision_monitor.session import Session
from collision_monitor.session.history.read_history import read_history
from collision_monitor.session.replaying.replay import replay
from collision_monitor.session.replaying.replay_report import Verdict
from collision_monitor.sources import Feed, RawMessage, load_mapping

SOURCES = """
frame: map
rate: 10
objects:
  robot: {topic: /odom, shape: {sphere: 0.3}}
  post:  {static: true, shape: {sphere: 0.2}, pose: [2, 1.2, 0]}
  gate:
    shape: {box: [0.2, 1, 1]}
    schedule:
      poses: {closed: [9, 0, 0], open: [9, 2, 0]}
      at: {0: closed, 1: open, 2: open}
      repeat: 3
plans:
  robot: {topic: /plan, speed: 1.0, acceleration: 1.0, headings: path, tolerance: {across: 0.3, angle: 2}}
"""
ODOMETRY = "nav_msgs/msg/Odometry"
BEND = [(0, 0, 0), (2, 0, 0), (2, 3, 0)]


def played() -> list[tuple[str, str, bytes]]:
    """The robot drives along the path for 2 s, slower than planned, and then past its bend."""
    found = []
    for k in range(40):
        stamp, speed = START + k * SECOND // 10, 0.8
        kind, message = odometry("map", stamp, (0.08 * k, 0, 0), (0, 0, 0, 1), (speed, 0, 0), (0, 0, 0))
        found.append(("/odom", kind, bytes(STORE.serialize_cdr(message, kind))))
        if k in (3, 20):
            kind, message = path(BEND, stamp=stamp)
            found.append(("/plan", kind, bytes(STORE.serialize_cdr(message, kind))))
    return found


def test_plans_over_dds_are_those_without_ros(start: Callable[..., Any], team: Any, tmp_path: Path) -> None:
    (tmp_path / "sources.yaml").write_text(SOURCES)
    classes = {"/odom": Odometry, "/plan": PathMessage}
    out = {topic: team.node.create_publisher(kind, topic, 10) for topic, kind in classes.items()}
    shown: list[bytes] = []
    watcher = subscription(team.node, Topic.MONITORED_PLANS, shown.append, Topic.MONITORED_PLANS.of())
    process = start("run", "--sources", "sources.yaml", "--record", "live.mcap")
    team.until(lambda: team.statuses, 60.0)
    team.until(lambda: all(each.get_subscription_count() for each in out.values()), 60.0)
    team.listen(0.2)
    for k, (topic, _, data) in enumerate(played()):
        out[topic].publish(data)
        time.sleep(0.3 if k < 6 else 0.03)  # the first ones find the code cold; they must not wait beside each other
    team.settle()
    late: list[bytes] = []
    other = subscription(team.node, Topic.MONITORED_PLANS, late.append, Topic.MONITORED_PLANS.of())
    team.until(lambda: len(late) >= 2, 20.0)
    assert process.stop() == 0, process.words

    feed = Feed(load_mapping(tmp_path / "sources.yaml"), decoder())
    expected = feed.begin(0)
    feed.bind("/odom", ODOMETRY)
    for topic, kind, data in played():
        expected += feed.take(RawMessage(topic, kind, data, 0))
    session = Session(tmp_path / "live.mcap")
    kinds = {Topic.STATES.message, Topic.SHAPES.message, Topic.TRAJECTORIES.message}
    live = [(m.type, bytes(m.data)) for m in session.messages() if m.type in kinds]
    assert live == [(each.topic.message, each.data) for each in expected], process.words
    assert not feed.scene.refused

    plans = [data for kind, data in live if kind == Topic.TRAJECTORIES.message]
    assert [data[: len(plan)] for data, plan in zip(shown, plans, strict=False)] == plans  # DDS fills up to 4 bytes
    last = {}
    for data in plans:
        for plan in decode_trajectories(data).trajectories:
            last[plan.object_id] = plan.times.tolist()
    found = {plan.object_id: plan.times.tolist() for data in late for plan in decode_trajectories(data).trajectories}
    assert found == last and set(last) == {1, 3}

    history = read_history(session)
    flags = {int(row["plans"]) for row in history.predictions if row["id_a"] == 1}
    assert PlanFlag.FOLLOWS_A in flags
    assert [(use.object_id, use.times_left) for use in history.plans] == [(1, 1), (3, 0)]
    assert replay(session).verdict is Verdict.IDENTICAL
    for each in (watcher, other):
        team.node.destroy_subscription(each)
