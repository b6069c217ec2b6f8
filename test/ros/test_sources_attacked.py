"""A node whose sources get what ended or silenced it once: it goes on, and says what it does not monitor."""

from __future__ import annotations

import copy
import time
from collections.abc import Callable
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from foreign_bag import STORE, odometry
from foreign_messages import POLYGON, laser_scan, point_cloud, track, tracked_objects
from rclpy.qos import DurabilityPolicy, QoSProfile
from ros_messages import message

from collision_monitor import Mesh
from collision_monitor.ros.monitor.large_messages import LargeMessages
from collision_monitor.ros.process import StopRequest, spin
from collision_monitor.sources import RawMessage

SPHERE = {"sphere": 0.5}
LATCHED = QoSProfile(depth=10, durability=DurabilityPolicy.TRANSIENT_LOCAL)
STRING = "std_msgs/msg/String"


class Publishers:
    """Publishers of a team by topic."""

    def __init__(self, node: Any, kinds: dict[str, str]) -> None:
        self._publishers = {
            topic: node.create_publisher(
                getattr(import_module(f"{kind.split('/')[0]}.msg"), kind.split("/")[2]),
                topic,
                LATCHED if kind == STRING else QoSProfile(depth=10),
            )
            for topic, kind in kinds.items()
        }

    def are_matched(self) -> bool:
        return all(each.get_subscription_count() for each in self._publishers.values())

    def send(self, topic: str, kind_and_content: tuple[str, Any]) -> None:
        kind, content = kind_and_content
        self._publishers[topic].publish(bytes(STORE.serialize_cdr(content, kind)))


def drive(stamp: int, x: float) -> tuple[str, Any]:
    return odometry("map", stamp, (x, 0, 0), (0, 0, 0, 1), (1, 0, 0), (0, 0, 0))


def test_what_ended_the_node_is_refused_and_the_others_are_monitored(
    start: Callable[..., Any], team: Any, tmp_path: Path
) -> None:
    objects = {
        "robot": {"topic": "/odom", "shape": {**SPHERE}},
        "lidar": {"topic": "/points"},
        "scan": {"topic": "/scan"},
        "cars": {"topic": "/tracks"},
        "lost": {"topic": "/odm", "shape": {**SPHERE}},
        "shelf": {"static": True, "frame": "odom", "shape": {**SPHERE}},
    }
    robots = {"arm": {"urdf_topic": "/robot_description", "base": {"pose": [5, 0, 0]}}}
    (tmp_path / "sources.yaml").write_text(yaml.safe_dump({"frame": "map", "objects": objects, "robots": robots}))
    publishers = Publishers(
        team.node,
        {
            "/odom": "nav_msgs/msg/Odometry",
            "/points": "sensor_msgs/msg/PointCloud2",
            "/scan": "sensor_msgs/msg/LaserScan",
            "/tracks": "autoware_perception_msgs/msg/TrackedObjects",
            "/robot_description": STRING,
        },
    )
    process = start("run", "--sources", "sources.yaml")
    team.until(lambda: team.statuses, 60.0)
    team.until(publishers.are_matched, 30.0)
    now = team.now
    cloud = point_cloud("map", now, [(1, 2, 3)])
    far = copy.deepcopy(cloud)
    far[1].fields[1].offset = 2**31 - 4
    late = drive(now, 0)
    late[1].header.stamp.sec, late[1].header.stamp.nanosec = 2**31 - 1, 2**32 - 1
    link = '<link name="a"><collision><geometry>{}</geometry></collision></link>'
    urdf = link.format('<box size="1 1 1"/>') + link.format(f'<mesh filename="{"n" * 300}.stl"/>').replace('"a"', '"b"')
    joint = '<joint name="j" type="fixed"><parent link="a"/><child link="b"/></joint>'
    attacks: list[tuple[str, tuple[str, Any]]] = [
        ("/points", cloud),
        ("/points", far),
        ("/odom", late),
        ("/scan", laser_scan("map", now, [np.nan, np.nan])),
        ("/tracks", tracked_objects("map", now, track(1, (0, 5, 0), kind=POLYGON, footprint=()))),
        ("/robot_description", (STRING, message(STRING, data=f'<robot name="r">{urdf}{joint}</robot>'))),
    ]
    for topic, attack in attacks:
        publishers.send(topic, attack)
        team.listen(0.2)
    steps = team.statuses[-1].step
    for k in range(20):
        publishers.send("/odom", drive(team.now, 0.05 * k))
        team.listen(0.05)
    team.until(lambda: team.statuses[-1].step >= steps + 15)
    team.listen(1.5)
    words = process.words
    for text in (
        "expected y within point_step 16, got 4 bytes at offset 2147483644",
        "stamp: expected a time from 1970 to 2038",
        "scan: ranges: expected measurements, got none in 2 beams; what was there stays",
        "a disc of its dimensions is monitored",
        "lost: /odm has no publisher",
        "shelf: expected static transforms from 'map' to 'odom'",
        "link b: expected the file",
    ):
        assert text in words, words
    assert words.count("not monitored: ") >= 3 and "Traceback" not in words
    assert team.statuses[-1].objects == 5  # robot, lidar, the track, the link a, and lost without a state
    assert process.stop() == 0


def test_a_urdf_with_large_meshes_does_not_silence_the_node(
    start: Callable[..., Any], team: Any, tmp_path: Path
) -> None:
    write_mesh(tmp_path / "part.stl", 100)  # 20,000 triangles
    links = "".join(
        f'<link name="l{k}"><collision><geometry><mesh filename="{tmp_path}/part.stl" scale="{1 + k / 10} 1 1"/>'
        f"</geometry></collision></link>"
        for k in range(12)
    )
    joints = "".join(
        f'<joint name="j{k}" type="fixed"><parent link="l0"/><child link="l{k}"/></joint>' for k in range(1, 12)
    )
    file = {
        "frame": "map",
        "objects": {"robot": {"topic": "/odom", "shape": {**SPHERE}}},
        "robots": {"arm": {"urdf_topic": "/robot_description", "base": {"pose": [50, 0, 0]}}},
    }
    (tmp_path / "sources.yaml").write_text(yaml.safe_dump(file))
    publishers = Publishers(team.node, {"/odom": "nav_msgs/msg/Odometry", "/robot_description": STRING})
    process = start("run", "--sources", "sources.yaml")
    team.until(lambda: team.statuses, 60.0)
    team.until(publishers.are_matched, 30.0)
    publishers.send("/robot_description", (STRING, message(STRING, data=f'<robot name="r">{links}{joints}</robot>')))
    gaps, last, deadline = [], time.monotonic(), time.monotonic() + 120
    while team.statuses[-1].objects < 13:
        assert time.monotonic() < deadline, process.words
        count = len(team.statuses)
        publishers.send("/odom", drive(team.now, 0.0))
        team.listen(0.05)
        if len(team.statuses) > count:
            gaps.append(time.monotonic() - last)
            last = time.monotonic()
    assert max(gaps) < 5.0, gaps  # its meshes take longer than that, one after the other, on a busy machine
    assert "is made beside the monitoring" in process.words or "not monitored" not in process.words
    assert process.stop() == 0


def write_mesh(path: Path, cells: int) -> None:
    """Write a wavy sheet of 2 * cells^2 triangles as a binary STL."""
    x, y = np.meshgrid(np.arange(cells + 1.0), np.arange(cells + 1.0), indexing="ij")
    z = np.sin(x) * np.cos(y)
    points = np.stack([x, y, z], -1) * 0.01
    a, b, c, d = points[:-1, :-1], points[1:, :-1], points[1:, 1:], points[:-1, 1:]
    triangles = np.concatenate([np.stack([a, b, c], 2), np.stack([a, c, d], 2)]).reshape(-1, 3, 3)
    Mesh(triangles.reshape(-1, 3), np.arange(3 * len(triangles)).reshape(-1, 3))  # it is one that can be monitored
    rows = np.zeros(len(triangles), np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("rest", "<u2")]))
    rows["corners"] = triangles
    path.write_bytes(bytes(80) + np.uint32(len(rows)).tobytes() + rows.tobytes())


# -- large messages, and callbacks that fail


def test_large_messages_of_a_topic_stay_in_order_and_their_errors_come_back() -> None:
    def decode(kind: str, data: bytes) -> bytes:
        time.sleep(0.001 if len(data) < 1000 else 0.1)
        if data.startswith(b"bad"):
            raise ValueError("expected another message")
        return data

    large = LargeMessages(decode)
    given = (b"0" * 300_000, b"1", b"bad")
    messages = [RawMessage("/a", "x", data, k) for k, data in enumerate(given)]
    assert large.takes(messages[0]) and not large.takes(messages[1])
    for each in messages:
        large.put(each)
        assert large.takes(messages[1])  # behind the large one
    found: list[Any] = []
    deadline = time.monotonic() + 20
    while len(found) < 3:
        assert time.monotonic() < deadline
        if (each := large.next()) is not None:
            found.append(each)
    assert [raw.received for raw, _ in found] == [0, 1, 2] and isinstance(found[2][1], ValueError)
    assert not large.takes(messages[1]) and large.next() is None
    large.close()
    assert not large.put(messages[0])


@pytest.mark.parametrize("events", [False, True])
def test_a_callback_that_raises_is_logged_and_the_others_go_on(
    events: bool, team: Any, capfd: pytest.CaptureFixture[str]
) -> None:
    import rclpy

    rclpy.init()
    try:
        node, stop, calls = rclpy.create_node("fails"), StopRequest(), []

        def failing() -> None:
            calls.append(1)
            stop.received = len(calls) >= 5
            raise KeyError("nobody expects it")

        node.create_timer(0.01, failing)
        spin(node, stop, events=events)
        node.destroy_node()
    finally:
        rclpy.try_shutdown()
    assert len(calls) >= 5
    words = capfd.readouterr().err
    assert words.count("a callback failed, the node goes on; please report this") == 1
    assert "KeyError: 'nobody expects it'" in words
