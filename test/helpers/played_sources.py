"""Sources files played without ROS: messages into the feed, and the objects and states that come out."""

from __future__ import annotations

from typing import Any

import numpy as np
from ros_messages import SECOND, cdr, definitions, header, message, pose, vector

from collision_monitor.codec import ObjectDescriptionArray, ObjectStateArray, decode_descriptions, decode_states
from collision_monitor.geometry.pose import from_rotation_vector
from collision_monitor.objects.description import ObjectDescription
from collision_monitor.pipeline.topics import Topic
from collision_monitor.robots.robot import Robot
from collision_monitor.sources.decoding import Decoder
from collision_monitor.sources.feed import Feed
from collision_monitor.sources.mapping import make_mapping
from collision_monitor.sources.source import RawMessage

START = 1_700_000_000 * SECOND
MILLISECOND = 1_000_000
JOINT_STATE, TF = "sensor_msgs/msg/JointState", "tf2_msgs/msg/TFMessage"
JOINTS = [*(f"joint_{k}" for k in range(1, 8)), "finger_joint"]


class Played:
    """A feed with the objects and the last states of its answers."""

    def __init__(self, robot: dict[str, Any] | None, **file: Any) -> None:
        content = {"frame": "map", **file, **({"robots": {"arm": robot}} if robot is not None else {})}
        self.feed = Feed(make_mapping(content), Decoder(definitions()))
        self.objects: dict[str, ObjectDescription] = {}
        self.states: dict[str, Any] = {}
        self.steps: list[ObjectStateArray] = []
        self.messages = 0
        self.bound: set[str] = set()
        self._read(self.feed.begin(START))

    def send(self, topic: str, kind: str, content: Any, received: int = START) -> None:
        self.states = {}
        if topic in self.feed.mapping.topics and topic not in self.bound:
            self.bound.add(topic)
            self.feed.bind(topic, kind)
        self._read(self.feed.take(RawMessage(topic, kind, cdr(kind, content), received)))

    def _read(self, inputs: Any) -> None:
        for each in inputs:
            self.messages += 1
            if each.topic is Topic.STATES:
                step = decode_states(each.data)
                self.steps.append(step)
                names = {it.object_id: name for name, it in self.objects.items()}
                self.states = {names[int(row["id"])]: row for row in step.states}
                continue
            described: ObjectDescriptionArray = decode_descriptions(each.data)
            assert not described.refused
            for change in described.objects:
                self.objects = {name: it for name, it in self.objects.items() if it.object_id != change.object_id}
                if isinstance(change, ObjectDescription):
                    self.objects[change.name] = change

    def joints(self, stamp: int, position: Any, velocity: Any = (), names: Any = JOINTS) -> None:
        content = message(
            JOINT_STATE,
            header=header("", stamp),
            name=list(names),
            position=np.array(position, np.float64),
            velocity=np.array(velocity, np.float64),
        )
        self.send("/joint_states", JOINT_STATE, content, stamp)

    @property
    def refusals(self) -> list[str]:
        return list(self.feed.scene.refused)


def base_row(position: Any, quaternion: Any = (0, 0, 0, 1), linear: Any = (0, 0, 0), angular: Any = (0, 0, 0)) -> Any:
    return np.concatenate([position, quaternion, linear, angular]).astype(float)


def check(played: Played, robot: Robot, joints: Any, base: Any, atol: float = 1e-12) -> None:
    """Compare all states with the kinematics of the robot."""
    assert played.states
    poses, twists = robot.motions(np.array(joints, np.float64), base)
    for name, state in played.states.items():
        row = robot.tree.links.index(name.removeprefix("arm/"))
        for field, expected in (
            ("position", poses[row, :3]),
            ("quaternion", poses[row, 3:]),
            ("linear", twists[row, :3]),
            ("angular", twists[row, 3:]),
        ):
            np.testing.assert_allclose(state[field], expected, rtol=0, atol=atol, err_msg=f"{name}, {field}")


def transform(stamp: int, parent: str, child: str, position: Any, quaternion: Any = (0, 0, 0, 1)) -> Any:
    where = pose(position, quaternion)
    inner = message("geometry_msgs/msg/Transform", translation=vector(*position), rotation=where.orientation)
    kind = "geometry_msgs/msg/TransformStamped"
    return message(TF, transforms=[message(kind, header=header(parent, stamp), child_frame_id=child, transform=inner)])


def turned(*rotation_vector: float) -> Any:
    return from_rotation_vector(rotation_vector)
