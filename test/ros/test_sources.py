"""The sources of a running node: real messages over real DDS, with the bytes of an import of the same bag."""

from __future__ import annotations

import time
from collections.abc import Callable
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np
import rclpy
import yaml
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from foreign_bag import SECOND, START, STORE, T, marker, markers, odometry, pose_stamped, transforms, write_bag
from foreign_messages import (
    detection,
    detections,
    footprint,
    laser_scan,
    point_cloud,
    predicted_objects,
    track,
    tracked_objects,
)
from geometry_msgs.msg import PoseStamped
from nav_msgs.msg import Odometry
from rclpy.qos import DurabilityPolicy, QoSProfile, qos_profile_sensor_data
from std_msgs.msg import Header

from collision_monitor.session import Session
from collision_monitor.session.replaying.replay import replay
from collision_monitor.session.replaying.replay_report import Verdict
from collision_monitor.sources import import_bag, load_mapping

STEP = 20_000_000
Messages = list[tuple[str, int, tuple[str, Any]]]
LATCHED = QoSProfile(depth=10, durability=DurabilityPolicy.TRANSIENT_LOCAL)


class Player:
    """Publishes the messages of a bag one after the other, each when the last one has been delivered."""

    def __init__(self, node: Any, messages: Messages) -> None:
        self._node, self._messages = node, messages
        self._publishers = {
            topic: node.create_publisher(
                getattr(import_module(f"{kind.split('/')[0]}.msg"), kind.split("/")[2]),
                topic,
                LATCHED if topic.endswith("static") else QoSProfile(depth=10),
            )
            for topic, _, (kind, _) in messages
        }

    def wait(self, team: Any) -> None:
        team.until(lambda: all(p.get_subscription_count() for p in self._publishers.values()), 60.0)
        team.listen(0.2)

    def play(self, gap: float = 0.04) -> None:
        for k, (topic, _, (kind, message)) in enumerate(self._messages):
            self._publishers[topic].publish(bytes(STORE.serialize_cdr(message, kind)))
            time.sleep(0.3 if k < 5 else gap)  # the first ones find the code cold; they must not wait beside each other


def inputs_of(path: Path) -> list[tuple[str, bytes]]:
    kinds = ("ObjectStateArray", "ObjectDescriptionArray")
    return [(m.type, bytes(m.data)) for m in Session(path).messages() if m.type in kinds]


def drive(steps: int = 15) -> Messages:
    """A robot that drives a circle, and a person that it sees."""
    found: Messages = [("/tf_static", START, transforms(START, ("map", "hall", (1, 2, 0), (0, 0, 0, 1))))]
    for k in range(steps):
        t, stamp = k * STEP / SECOND, START + k * STEP
        q = (0, 0, np.sin(t / 2), np.cos(t / 2))
        p = (2 * np.sin(t), 2 - 2 * np.cos(t), 0)
        found += [
            ("/tf", stamp, transforms(stamp, ("hall", "base", p, q))),
            ("/odom", stamp, odometry("hall", stamp, p, q, (2, 0, 0), (0, 0, 1))),
            ("/person", stamp, pose_stamped("base", stamp + 7, (3 - t, 0.25, 0))),
        ]
    return found


def everything(steps: int = 12) -> tuple[dict[str, Any], Messages]:
    """Entries for one topic of each kind, and their messages beside those of `drive`."""
    square = np.array([(0.4, 0.4), (-0.4, 0.4), (-0.4, -0.4), (0.4, -0.4)])
    found: Messages = []
    for k in range(steps):
        t, stamp = k * STEP / SECOND, START + k * STEP
        stamped = pose_stamped("map", stamp, (9, t, 0))[1]
        covariance = T["geometry_msgs/msg/PoseWithCovariance"](stamped.pose, np.diag([0.01] * 6).ravel())
        cup = T["geometry_msgs/msg/PoseWithCovarianceStamped"](stamped.header, covariance)
        crate = marker("crates", 7, 1, (1, 1, 1), (-4, t, 0), frame="map", stamp=stamp)
        found += [
            ("/covariance", stamp, ("geometry_msgs/msg/PoseWithCovarianceStamped", cup)),
            ("/footprint", stamp, footprint("base", stamp, square + np.array([-5, t]))),
            ("/marker", stamp, ("visualization_msgs/msg/Marker", crate)),
            ("/markers", stamp, markers(marker("posts", 1, 3, (0.2, 0.2, 2), (7, 7, 0), frame="map", stamp=stamp))),
            ("/tracked", stamp, tracked_objects("base", stamp, track(1, (20 + t, 0, 0), linear=(1, 0, 0)))),
            ("/predicted", stamp, predicted_objects("map", stamp, track(2, (0, 30, 0), predicted=True))),
            ("/detections", stamp, detections("base", stamp, detection((2, -t, 0), name="7", variance=0.01))),
            ("/scan", stamp, laser_scan("base", stamp, [3 + t, np.inf, np.nan, 4, 5])),
            ("/cloud", stamp, point_cloud("base", stamp, [(0.1, 0, 0), (9, t, 0), (np.nan, 0, 0), (9, 1, t)])),
        ]
    entries = {
        "cup": {"topic": "/covariance", "shape": {"sphere": 0.1}},
        "trolley": {"topic": "/footprint", "height": 1.0},
        "crate": {"topic": "/marker", "marker": {"ns": "crates", "id": 7}},
        "post": {"topic": "/markers", "marker": {"ns": "posts"}, "static": True},
        "gripper": {"topic": "/tf", "frame": "base", "shape": {"sphere": 0.1}, "allowed": ["robot"]},
        "cars": {"topic": "/tracked"},
        "others": {"topic": "/predicted"},
        "people": {"topic": "/detections"},
        "walls": {"topic": "/scan", "radius": 0.1},
        "depth": {"topic": "/cloud", "voxel": 0.01, "without": ["robot"]},
    }
    return entries, found


ROBOT_AND_PERSON = {
    "robot": {"topic": "/odom", "shape": {"box": [1.2, 0.8, 0.5]}},
    "person": {"topic": "/person", "shape": {"capsule": [0.3, 1.1]}},
}


def test_a_bag_over_dds_gives_the_bytes_of_its_import(start: Callable[..., Any], team: Any, tmp_path: Path) -> None:
    compare_with_import({"frame": "map", "objects": ROBOT_AND_PERSON}, drive(8), start, team, tmp_path)


def test_every_kind_of_message_over_dds_gives_the_bytes_of_its_import(
    start: Callable[..., Any], team: Any, tmp_path: Path
) -> None:
    entries, others = everything()
    first, *rest = drive(12)
    messages = [first, *sorted([*rest, *others], key=lambda message: message[1])]  # stable: transforms first
    content = {"frame": "map", "rate": 25, "objects": {**entries, **ROBOT_AND_PERSON}}
    states = compare_with_import(content, messages, start, team, tmp_path)
    assert {name for name, count in states.items() if count} == {
        *("robot", "person", "cup", "trolley", "crate", "gripper", "cars_car_1", "others_car_1", "people_person_7"),
    }


def compare_with_import(
    content: dict[str, Any], messages: Messages, start: Callable[..., Any], team: Any, folder: Path
) -> dict[str, int]:
    """Play the messages to a node with this sources file; return the number of states of each object."""
    (folder / "sources.yaml").write_text(yaml.safe_dump(content, sort_keys=False))
    player = Player(team.node, messages)
    keep_every_step = ("--ros-args", "-p", "keep_up:=false")  # however busy the machine is
    process = start("run", "--sources", "sources.yaml", "--record", "live.mcap", *keep_every_step)
    team.until(lambda: team.statuses, 60.0)
    player.wait(team)
    player.play()
    team.settle()
    assert process.stop() == 0, process.words
    bag = write_bag(folder / "bag", messages)
    imported = import_bag(bag, folder / "imported.mcap", load_mapping(folder / "sources.yaml"))
    assert imported.whole, imported
    assert inputs_of(folder / "live.mcap") == inputs_of(folder / "imported.mcap"), process.words
    assert len(inputs_of(folder / "live.mcap")) > 7
    assert replay(Session(folder / "live.mcap")).verdict is Verdict.IDENTICAL
    return imported.states


def test_a_line_that_cannot_be_used_is_named_and_the_rest_is_monitored(
    start: Callable[..., Any], team: Any, tmp_path: Path
) -> None:
    (tmp_path / "sources.yaml").write_text(
        "frame: map\nobjects:\n"
        "  robot: {topic: /odom, shape: {sphere: 1}}\n"
        "  wrong: {topic: /person, type: nav_msgs/Odometry, shape: {sphere: 1}}\n"
        "  unfit: {topic: /tf, shape: {sphere: 1}}\n"
        "  never: {topic: /nothing, shape: {sphere: 1}}\n"
    )
    player = Player(team.node, drive(5))
    reports: list[Any] = []
    team.node.create_subscription(DiagnosticArray, "/object_monitor/sources", reports.append, 1)
    process = start("run", "--sources", "sources.yaml")
    team.until(lambda: reports, 60.0)
    team.until(lambda: "source /odom" in process.words, 30.0)
    player.play()
    team.until(lambda: level_of(reports[-1], "robot") == (DiagnosticStatus.OK, "ok"), 30.0)
    words = process.words
    assert "sources.yaml, line 4: wrong: expected /person to carry nav_msgs/msg/Odometry, got geometry_msgs" in words
    assert "sources.yaml, line 5: unfit: /tf is a tf2_msgs/msg/TFMessage; expected `frame: …`, got none" in words
    assert level_of(reports[-1], "wrong")[0] == DiagnosticStatus.ERROR
    assert level_of(reports[-1], "never") == (DiagnosticStatus.WARN, "/nothing has no publisher")
    assert team.statuses[-1].objects == 4
    assert process.stop() == 0


def test_publishers_that_come_later_are_heard_or_listed(
    start: Callable[..., Any], team: Any, tmp_path: Path, ros_domain_id: int
) -> None:
    """The first one is reliable. DDS gives its subscription nothing of one that is not, nor of another type."""
    (tmp_path / "sources.yaml").write_text("frame: map\nobjects: {robot: {topic: /odom, shape: {sphere: 1}}}\n")
    reliable = team.node.create_publisher(Odometry, "/odom", 10)
    reports: list[Any] = []
    team.node.create_subscription(DiagnosticArray, "/object_monitor/sources", reports.append, 1)
    process = start("run", "--sources", "sources.yaml")
    team.until(lambda: "source /odom" in process.words, 60.0)

    def moves(publisher: Any) -> bool:
        message = Odometry(header=Header(frame_id="map", stamp=team.node.get_clock().now().to_msg()))
        message.pose.pose.orientation.w = 1.0
        steps = team.statuses[-1].step
        publisher.publish(message)
        team.listen(0.1)
        return bool(team.statuses[-1].step > steps)

    team.until(lambda: team.statuses and moves(reliable), 30.0)
    context = rclpy.Context()  # one participant has one type of a topic
    context.init(domain_id=ros_domain_id)
    stranger = rclpy.create_node("stranger", context=context)
    stranger.create_publisher(PoseStamped, "/odom", 10)
    team.until(lambda: "/odom carries geometry_msgs/msg/PoseStamped too, which is not taken" in process.words, 20.0)
    best_effort = team.node.create_publisher(Odometry, "/odom", qos_profile_sensor_data)
    team.until(lambda: moves(best_effort), 20.0)
    team.until(lambda: moves(reliable), 10.0)
    stranger.destroy_node()
    context.shutdown()
    team.until(lambda: not any("another type" in each.name for each in reports[-1].status), 10.0)
    assert process.stop() == 0


def level_of(report: Any, name: str) -> tuple[bytes, str]:
    status = next(each for each in report.status if each.name == f"object_monitor: {name}")
    return status.level, status.message


def test_a_check_lists_what_would_not_be_monitored(start: Callable[..., Any], tmp_path: Path) -> None:
    (tmp_path / "sources.yaml").write_text(
        "frame: map\nrate: 20\nobjects:\n"
        "  cart: {topic: /odm, shape: {sphere: 1}}\n"
        "  shelf: {static: true, frame: hall, shape: {sphere: 1}}\n"
    )
    check = start("sources", "--check", "sources.yaml", "--seconds", "3")
    assert check.wait() == 3
    assert "not monitored: sources.yaml, line 4: cart: /odm has no publisher\n" in check.words
    assert "not monitored: sources.yaml, line 5: shelf: expected static transforms from 'map' to 'hall'" in check.words


def test_the_graph_is_listed_and_the_file_to_start_from_works(
    start: Callable[..., Any], team: Any, tmp_path: Path
) -> None:
    player = Player(team.node, drive(3))
    command = start("sources", "--seconds", "8")
    player.wait(team)
    player.play()
    assert command.wait() == 0, command.words
    text = command.words[command.words.index("frame:") :]
    assert "frame: map\nrate: 20" in text
    (tmp_path / "sources.yaml").write_text(text)
    assert {entry.topic for entry in load_mapping(tmp_path / "sources.yaml").sources} == {"/odom", "/person"}
    check = start("sources", "--check", "sources.yaml", "--seconds", "8")
    player.wait(team)
    player.play()
    assert check.wait() in (0, 3)
    assert "person: /person geometry_msgs/msg/PoseStamped" in check.words
