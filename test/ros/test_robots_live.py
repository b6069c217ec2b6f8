"""A robot over DDS: its URDF, joints and planning scene give the node the bytes that they give without ROS."""

from __future__ import annotations

import subprocess
import sys
import time
from collections.abc import Callable
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from played_sources import JOINT_STATE, JOINTS, MILLISECOND, START
from rclpy.qos import DurabilityPolicy, QoSProfile
from ros_messages import cdr, definitions, header, message, pose

from collision_monitor.pipeline.topics import Topic
from collision_monitor.session import Session
from collision_monitor.session.replaying.replay import replay
from collision_monitor.session.replaying.replay_report import Verdict
from collision_monitor.sources import Decoder, Feed, RawMessage, load_mapping

ARM = Path(__file__).parents[2] / "examples/arm/arm.urdf"
STRING, SCENE = "std_msgs/msg/String", "moveit_msgs/msg/PlanningScene"
SOURCES = {
    "frame": "map",
    "rate": 50,
    "robots": {
        "arm": {
            "urdf_topic": "/robot_description",
            "joint_states": "/joint_states",
            "base": {"pose": [0, 0, 0]},
            "planning_scene": "/monitored_planning_scene",
        }
    },
}


def joints(k: int) -> Any:
    position = np.array([0.05 * k, 0.2, 0.0, -2.0, 0.0, 2.2, 0.785, 0.03])
    stamp = START + 10 * k * MILLISECOND
    return message(JOINT_STATE, header=header("", stamp), name=JOINTS, position=position, velocity=5.0 * np.eye(8)[0])


def scene(*objects: Any, held: Any = ()) -> Any:
    world = message("moveit_msgs/msg/PlanningSceneWorld", collision_objects=list(objects))
    state = message("moveit_msgs/msg/RobotState", attached_collision_objects=list(held), is_diff=True)
    return message(SCENE, is_diff=True, world=world, robot_state=state)


def ball(name: str, frame: str, *position: float) -> Any:
    solid = message("shape_msgs/msg/SolidPrimitive", type=2, dimensions=np.array([0.05]))
    fields = {"primitives": [solid], "primitive_poses": [pose()], "pose": pose(position)}
    return message("moveit_msgs/msg/CollisionObject", header=header(frame, START), id=name, **fields)


def played() -> list[tuple[str, str, Any]]:
    held = message("moveit_msgs/msg/AttachedCollisionObject", link_name="hand", object=ball("cup", "hand", 0, 0, 0.15))
    return [
        ("/robot_description", STRING, message(STRING, data=ARM.read_text())),
        ("/monitored_planning_scene", SCENE, scene(ball("post", "map", 0.45, 0.4, 0.36))),
        *(("/joint_states", JOINT_STATE, joints(k)) for k in range(8)),
        ("/monitored_planning_scene", SCENE, scene(held=[held])),
        *(("/joint_states", JOINT_STATE, joints(k)) for k in range(8, 20)),
    ]


def test_a_robot_over_dds(start: Callable[..., Any], team: Any, tmp_path: Path) -> None:
    pytest.importorskip("moveit_msgs.msg", reason="`make interfaces` builds moveit_msgs")
    (tmp_path / "sources.yaml").write_text(yaml.safe_dump(SOURCES))
    publishers = {}
    for topic, kind, _ in played():
        package, _, name = kind.split("/")
        latched = DurabilityPolicy.TRANSIENT_LOCAL if kind == STRING else DurabilityPolicy.VOLATILE
        quality = QoSProfile(depth=10, durability=latched)
        message_class = getattr(import_module(f"{package}.msg"), name)
        publishers[topic] = publishers.get(topic) or team.node.create_publisher(message_class, topic, quality)
    process = start("run", "--sources", "sources.yaml", "--record", "live.mcap")
    team.until(lambda: team.statuses, 60.0)
    team.until(lambda: all(each.get_subscription_count() for each in publishers.values()), 60.0)
    team.listen(0.2)
    for k, (topic, kind, content) in enumerate(played()):
        publishers[topic].publish(cdr(kind, content))
        time.sleep(0.3 if k < 5 else 0.04)  # the first ones find the code cold; they must not wait beside each other
    team.settle()
    assert process.stop() == 0, process.words

    feed = Feed(load_mapping(tmp_path / "sources.yaml"), Decoder(definitions()))
    expected = feed.begin(0)
    for topic, kind, content in played():
        expected += feed.take(RawMessage(topic, kind, cdr(kind, content), 0))
    kinds = {Topic.STATES.message, Topic.SHAPES.message, Topic.TRAJECTORIES.message}
    live = [(m.type, bytes(m.data)) for m in Session(tmp_path / "live.mcap").messages() if m.type in kinds]
    assert live == [(each.topic.message, each.data) for each in expected], process.words
    assert sum(kind == Topic.STATES.message for kind, _ in live) == 10 and not feed.scene.refused
    assert replay(Session(tmp_path / "live.mcap")).verdict is Verdict.IDENTICAL


def test_the_example_of_an_arm_predicts_and_touches(ros_domain_id: int) -> None:
    example = ARM.with_name("arm.py")
    done = subprocess.run(
        [sys.executable, str(example), "--seconds", "2.5"], capture_output=True, text=True, timeout=100, check=True
    )
    assert "s post meets arm/hand" in done.stdout and "now post touches arm/hand" in done.stdout, done.stderr
