"""The section `robots:` of a sources file to start from."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Final

from collision_monitor.sources.messages.poses import ODOMETRY
from collision_monitor.sources.robot.planning_scene import PLANNING_SCENE
from collision_monitor.sources.robot.robot_source import JOINT_STATE, TEXT

DESCRIPTIONS: Final = {"robot_description": "urdf_topic", "robot_description_semantic": "srdf_topic"}
"""Keys of an entry by the usual last names of their topics, which carry std_msgs/String."""


def is_of_robot(topic: str, kind: str) -> bool:
    """Return whether a topic belongs to a robot."""
    return kind == JOINT_STATE or (kind == TEXT and topic.rpartition("/")[2] in DESCRIPTIONS)


def robot_lines(topics: Iterable[tuple[str, str]]) -> list[str]:
    """Return the section for the topics (name, type) that are there: one robot for each topic of joint states."""
    given = sorted(topics)
    lines: list[str] = []
    for joints, kind in given:
        if kind != JOINT_STATE:
            continue
        space = joints.rpartition("/")[0]
        beside = {name: kind for name, kind in given if name.rpartition("/")[0] == space}
        keys = {
            DESCRIPTIONS[name.rpartition("/")[2]]: name
            for name, kind in beside.items()
            if kind == TEXT and is_of_robot(name, kind)
        }
        if "urdf_topic" not in keys:
            keys["urdf"] = "robot.urdf"
        keys["joint_states"] = joints
        if scenes := [name for name, kind in beside.items() if kind == PLANNING_SCENE]:
            keys["planning_scene"] = scenes[0]
        odometry = next((name for name, kind in beside.items() if kind == ODOMETRY), "/odom")
        lines.append(f"  {space.strip('/').replace('/', '_') or 'robot'}:")
        lines += [f"    {key}: {value}" for key, value in keys.items()]
        lines.append("    # base: {frame: base_link}    # its frame in tf, if that is not the base link's name")
        lines.append(f"    # base: {{odometry: {odometry}}}  # or {{pose: [0, 0, 0]}} where it is bolted")
    return ["robots:", *lines] if lines else []
