"""`top` and `echo` against a running monitor, and a survey of topics that come late, seldom, and do not move."""

from __future__ import annotations

import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
import yaml

pytest.importorskip("visualization_msgs.msg")
from rclpy.qos import QoSProfile
from visualization_msgs.msg import Marker, MarkerArray

from collision_monitor.sources.ground.mapping import load_mapping

NAME = "hall/object_monitor"


def test_top_and_echo_show_a_monitor_in_a_namespace(start: Callable[..., Any], team: Any) -> None:
    start("run", "--ros-args", "-r", "__ns:=/hall")
    world = start("world", "crossing", "--duration", "40", "--ros-args", "-p", f"monitor:={NAME}")
    count = team.node.count_publishers
    team.until(lambda: count(f"/{NAME}/status") and count(f"/{NAME}/contacts"), 60)
    top = start("top", "--monitor", f"/{NAME}", "--seconds", "6")
    names = start("echo", "--list")
    status = start("echo", f"{NAME}/status", "--count", "2")
    shapes = start("echo", f"/{NAME}/objects/shapes", "--count", "1", "--elements", "1")
    nothing = start("echo", "/hall/object_monitr/status", "--timeout", "2")
    no_monitor = start("top", "--monitor", "haul/object_monitor")
    assert nothing.wait() == 1
    assert f"expected a publisher of /hall/object_monitr/status, got none; there are /{NAME}/status" in nothing.words
    for process in (top, names, status, shapes):
        assert process.wait() == 0, process.words
    lines = top.words.splitlines()
    assert 3 <= len(lines) <= 8 and all(" touching, " in line and " objects, " in line for line in lines), top.words
    assert f"/{NAME}/contacts  collision_monitor_msgs/msg/ContactArray" in names.words.splitlines()
    first, second, rest = status.words.split("---\n")
    assert rest == "" and yaml.safe_load(first)["header"]["frame_id"] == "world"
    assert yaml.safe_load(second)["profile"] == "balanced"
    objects = yaml.safe_load(shapes.words.removesuffix("---\n"))["objects"]
    assert len(objects) == 2 and objects[0]["name"] and objects[1].endswith("in all")
    assert no_monitor.wait() == 1
    assert "expected a status of the monitor /haul/object_monitor within 10 s, got none" in no_monitor.words
    assert world.running


def test_a_survey_waits_for_what_comes_late_and_proposes_that_what_stands_is_static(
    start: Callable[..., Any], team: Any, tmp_path: Path
) -> None:
    """A wall of markers at 1 Hz that was no static object was stale every time before its next message."""
    walls = team.node.create_publisher(MarkerArray, "/walls", QoSProfile(depth=1))
    count = 0

    def publish(publisher: Any, namespace: str, speed: float) -> None:
        nonlocal count
        count += 1
        made = [Marker(ns=namespace, id=k, type=Marker.CUBE, action=Marker.ADD) for k in range(3)]
        for k, marker in enumerate(made):
            marker.header.frame_id = "map"
            marker.pose.position.x, marker.pose.orientation.w = 3.0 * k + speed * count, 1.0
            marker.scale.x = marker.scale.y = marker.scale.z = 1.0
        publisher.publish(MarkerArray(markers=made))

    team.node.create_timer(1.0, lambda: publish(walls, "wall", 0.0))
    command = start("sources")
    team.until(lambda: walls.get_subscription_count(), 30)
    team.listen(1.5)
    long_name = "/a_rather_long_namespace_of_a_robot/carts_of_the_hall"
    late = team.node.create_publisher(MarkerArray, long_name, QoSProfile(depth=1))
    team.node.create_timer(0.2, lambda: publish(late, "cart", 0.1))
    began = time.monotonic()
    team.until(lambda: not command.running, 30)
    assert time.monotonic() - began > 1.5
    text = command.words[command.words.index("frame:") :]
    (tmp_path / "sources.yaml").write_text(text)
    entries = {entry.topic: entry for entry in load_mapping(tmp_path / "sources.yaml").sources}
    assert {topic: entry.static for topic, entry in entries.items()} == {"/walls": True, late.topic_name: False}
    listed = command.words[: command.words.index("frame:")]
    assert max(map(len, listed.splitlines())) <= 80
    assert {"/walls", late.topic_name} <= set(listed.splitlines())
    assert "    visualization_msgs/MarkerArray, 1.0 Hz, frames: map" in listed.splitlines()
