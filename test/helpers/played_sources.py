"""Robots and planning scenes played without ROS: a feed that knows its objects and last states by name."""

from __future__ import annotations

from typing import Any

import numpy as np
from fed import Fed, in_world
from ros_messages import SECOND, header, message, pose, vector

from collision_monitor.objects.description import ObjectDescription
from collision_monitor.robots.robot import Robot
from collision_monitor.shapes.pose import from_rotation_vector
from collision_monitor.sources import Input

START = 1_700_000_000 * SECOND
MILLISECOND = 1_000_000
JOINT_STATE, TF = "sensor_msgs/msg/JointState", "tf2_msgs/msg/TFMessage"
JOINTS = [*(f"joint_{k}" for k in range(1, 8)), "finger_joint"]


class Played(Fed):
    """objects: by name. states: of the last message, by the objects' names. messages: number of inputs so far."""

    def __init__(self, robot: dict[str, Any] | None, **file: Any) -> None:
        self.objects: dict[str, ObjectDescription] = {}
        self.states: dict[str, Any] = {}
        self.messages = 0
        super().__init__(begin=START, **file, **({} if robot is None else {"robots": {"arm": robot}}))

    def send(self, topic: str, kind: str, content: Any, received: int = START) -> None:
        self.states = {}
        self.give(topic, received, (kind, content))

    def _keep(self, inputs: list[Input]) -> None:
        for each in inputs:
            steps, changes = len(self.steps), len(self.changes)
            super()._keep([each])
            self.messages += 1
            for step in self.steps[steps:]:
                names = {it.object_id: name for name, it in self.objects.items()}
                self.states = {names[int(row["id"])]: row for row in in_world(step.states)}
            for change in self.changes[changes:]:
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
    poses, twists = robot.states(np.array(joints, np.float64), base)
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
