"""The section `robots:` of a sources file: its robots, and their planning scenes."""

from __future__ import annotations

from typing import Any

from collision_monitor.objects.description import ObjectDescription
from collision_monitor.sources.ground.mapping import Mapping
from collision_monitor.sources.ground.source import Source
from collision_monitor.sources.robot.planning_scene import PLANNING_SCENE, Describe, PlanningSceneSource
from collision_monitor.sources.robot.robot_entry import RobotEntry, read_robots
from collision_monitor.sources.robot.robot_source import RobotSource


def make_robots(content: Any, mapping: Mapping) -> list[Source]:
    """Return the sources of the section. Raises InputError."""
    fleet: list[RobotSource] = []
    scenes: list[Source] = []
    for entry in read_robots(content, mapping):
        fleet.append(RobotSource(entry, mapping, fleet))
        if entry.planning_scene:
            topics = {entry.planning_scene: (PLANNING_SCENE,)}
            scenes.append(PlanningSceneSource(entry.name, topics, _describe(entry), fleet[-1]))
    return [*fleet, *scenes]


def _describe(entry: RobotEntry) -> Describe:
    """Return what describes the world of a robot's planning scene: with the robot's padding, group and mask."""
    return lambda object_id, name, shapes, at: ObjectDescription(
        object_id, shapes, name=name, static=True, pose=at, padding=entry.padding, group=entry.group, mask=entry.mask
    )
