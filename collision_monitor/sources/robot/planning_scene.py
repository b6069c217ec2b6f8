"""MoveIt's planning scene as a source: static objects of the world, objects that a robot holds, rules for its links.

The world has no speeds, so its objects are static. Only changes are described again: a scene that repeats itself costs
nothing in the monitor. Octomaps and fixed_frame_transforms are not read.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, Final

from collision_monitor.errors import CollisionMonitorError
from collision_monitor.objects.description import ObjectDescription
from collision_monitor.shapes.pose import Pose
from collision_monitor.sources.ground.frames import FrameMotion, MissingFrame
from collision_monitor.sources.ground.mapping import Mapping as SourcesFile
from collision_monitor.sources.ground.object_entry import ObjectEntry
from collision_monitor.sources.ground.source import Source
from collision_monitor.sources.ground.source_scene import SourceScene
from collision_monitor.sources.robot.carried_bodies import Body
from collision_monitor.sources.robot.collision_objects import (
    REMOVE,
    CollisionObject,
    Parts,
    collision_object,
    operation_of,
)
from collision_monitor.sources.robot.link_rules import LinkRules
from collision_monitor.sources.robot.planning_rules import PlanningRules
from collision_monitor.sources.robot.robot_source import RobotSource

PLANNING_SCENE: Final = "moveit_msgs/msg/PlanningScene"
COLLISION_OBJECT: Final = "moveit_msgs/msg/CollisionObject"

MOST_OBJECTS: Final = 10_000
"""Objects of a planning scene."""

Describe = Callable[[int, str, Parts, Pose], ObjectDescription]
"""Describes a static object: id, name, shapes, pose."""


def planning_world(entry: ObjectEntry, message_type: str, mapping: SourcesFile) -> PlanningSceneSource:
    """Return the source of an entry of `objects:`: a world without a robot. Raises InputError."""
    entry.allow_only((), message_type)
    return PlanningSceneSource(
        entry.name,
        {entry.topic: (message_type,)},
        lambda object_id, name, shapes, at: entry.describe(object_id, name, shapes, at=at),
        None,
    )


@dataclass(eq=False)
class WorldObject:
    """An object of the world. at: its pose in the monitor's frame, None while tf does not know its frame."""

    object_id: int
    content: CollisionObject
    at: Pose | None = None


@dataclass(eq=False)
class HeldObject:
    """An attached object. offset: its pose in the frame of the link, None while that is not known."""

    object_id: int
    content: CollisionObject
    link: str
    touch: frozenset[str]
    offset: Pose | None = None


class PlanningSceneSource(Source):
    """The planning scene of one robot, or of none. describe: makes the descriptions of the world's objects."""

    speaks = False

    def __init__(
        self, name: str, topics: Mapping[str, tuple[str, ...]], describe: Describe, robot: RobotSource | None
    ) -> None:
        self.topics = topics
        self.name = name
        self._describe = describe
        self._robot = robot
        self._world: dict[str, WorldObject] = {}
        self._held: dict[str, HeldObject] = {}
        self._rules = PlanningRules(name)
        self._ids: dict[str, int] = {}
        self._is_changed = False
        self._waits = False  # whether an object is not placed yet

    def take(self, topic: str, content: Any, stamp_ns: int, scene: SourceScene) -> None:
        """See Source."""
        if hasattr(content, "world"):
            self._take_scene(content, stamp_ns, scene)
        else:
            self._change_world(content, scene)
        self._place(stamp_ns, scene, is_new=True)

    def settle(self, now_ns: int, scene: SourceScene) -> None:
        """See Source. Places the objects whose frames are known by now."""
        self._place(now_ns, scene, is_new=False)

    # -- messages

    def _take_scene(self, content: Any, stamp_ns: int, scene: SourceScene) -> None:
        objects = content.world.collision_objects
        if not content.is_diff:
            for name in sorted(self._world.keys() - {each.id for each in objects}):
                self._drop(name, scene)
        for each in objects:
            self._change_world(each, scene)
        if len(content.world.octomap.octomap.data):
            scene.refuse(self.name, "the octomap of the planning scene is not monitored; give its points as a topic")
        self._is_changed |= self._rules.take(content, scene)
        attached = content.robot_state.attached_collision_objects
        if self._robot is None:
            if attached:
                scene.refuse(self.name, "expected attached objects in the planning scene of an entry of `robots:`")
            return
        if not (content.is_diff or content.robot_state.is_diff):
            for name in sorted(self._held.keys() - {each.object.id for each in attached}):
                scene.remove(self._held.pop(name).object_id)
                self._is_changed = True
        for each in attached:
            self._change_held(each, stamp_ns, scene)

    def _change_world(self, message: Any, scene: SourceScene) -> None:
        name = str(message.id)
        known = self._world.get(name)
        try:
            if operation_of(message) == REMOVE:
                for each in [name] if name else list(self._world):
                    self._drop(each, scene)
                return
            content = collision_object(message, known.content if known else None)
        except CollisionMonitorError as error:
            scene.refuse(self.name, f"{name:.80}: {error}")
            return
        if known is None and len(self._world) >= MOST_OBJECTS:
            scene.refuse(self.name, f"expected at most {MOST_OBJECTS} objects in the planning scene")
            return
        if known is None or known.content.fingerprint != content.fingerprint:
            self._world[name] = WorldObject(self._id(name, scene), content)
            self._is_changed = True

    def _drop(self, name: str, scene: SourceScene) -> None:
        gone = self._world.pop(name, None)
        if gone is not None:
            scene.remove(gone.object_id)
            self._is_changed = True

    def _change_held(self, message: Any, stamp_ns: int, scene: SourceScene) -> None:
        """Attach or detach an object. A detached one stays in the world where it is, as in MoveIt."""
        name, link = str(message.object.id), str(message.link_name)
        try:
            if operation_of(message.object) == REMOVE:
                for each in [name] if name else [k for k, held in self._held.items() if link in ("", held.link)]:
                    self._let_go(each, stamp_ns, scene)
                return
            solids = message.object.primitives, message.object.meshes, message.object.planes
            known = self._world.get(name)
            held = self._held.get(name)
            if not any(map(len, solids)) and known is not None:  # an object of the world is picked up
                content = known.content
            else:
                content = collision_object(message.object, held.content if held else None)
        except CollisionMonitorError as error:
            scene.refuse(self.name, f"{name:.80}: {error}")
            return
        touch = frozenset(map(str, message.touch_links))
        same = held is not None and held.content.fingerprint == content.fingerprint
        if held is not None and same and (held.link, held.touch) == (link, touch):
            return
        self._world.pop(name, None)
        self._held[name] = HeldObject(self._id(name, scene), content, link, touch)
        self._is_changed = True

    def _let_go(self, name: str, stamp_ns: int, scene: SourceScene) -> None:
        held = self._held.pop(name, None)
        if held is None or self._robot is None:
            return
        self._is_changed = True
        link = self._robot.link_motion(held.link, stamp_ns, scene)
        if link is None or held.offset is None:
            scene.refuse(self.name, f"{name:.80}: it was detached while the pose of {held.link} was not known")
            scene.remove(held.object_id)
            return
        try:
            at = Pose(link.position, link.quaternion) @ held.offset
        except CollisionMonitorError as error:
            scene.refuse(self.name, f"{name:.80}: {error}")
            scene.remove(held.object_id)
            return
        content = CollisionObject(name, held.content.shapes, scene.frame, at)
        self._world[name] = WorldObject(held.object_id, content)

    def _id(self, name: str, scene: SourceScene) -> int:
        """Return the id of an object, which it keeps when it is attached or comes again."""
        if name not in self._ids:
            if len(self._ids) >= 2 * MOST_OBJECTS:
                self._ids = {each: i for each, i in self._ids.items() if each in self._world or each in self._held}
            self._ids[name] = scene.new_id()
        return self._ids[name]

    # -- the scene

    def _place(self, now_ns: int, scene: SourceScene, *, is_new: bool) -> None:
        """Describe the objects whose frames are known. is_new: count those whose frames are not."""
        if not (is_new or self._waits or self._is_changed):
            return
        for name, it in self._world.items():
            if it.at is None:
                self._place_in_world(name, it, now_ns, scene, is_new)
        robot = self._robot
        self._waits = any(it.at is None for it in self._world.values())
        if robot is None or robot.robot is None:
            return
        for name, held in self._held.items():
            if held.offset is None:
                try:
                    held.offset = self._offset(name, held, now_ns, scene, is_new)
                except CollisionMonitorError as error:
                    scene.refuse(self.name, f"{name:.80}: {error}")
                self._is_changed |= held.offset is not None
                self._waits |= held.offset is None
        if self._is_changed:
            self._is_changed = False
            bodies = {
                name: Body(it.object_id, f"{robot.name}/{name}", it.link, it.content.shapes, it.offset, it.touch)
                for name, it in self._held.items()
                if it.offset is not None
            }
            robot.carry(bodies, self._carried_rules(robot.link_ids), scene)

    def _place_in_world(self, name: str, it: WorldObject, now_ns: int, scene: SourceScene, is_new: bool) -> None:
        frame = scene.frames.motion(scene.frame, it.content.frame or scene.frame, now_ns)
        if isinstance(frame, MissingFrame):
            if is_new:
                scene.refuse(self.name, f"{name:.80}: {frame}")
            return
        try:
            it.at = Pose(frame.position, frame.quaternion) @ it.content.pose
            scene.describe(self._describe(it.object_id, f"{self.name}/{name}", it.content.shapes, it.at))
        except CollisionMonitorError as error:
            scene.refuse(self.name, f"{name:.80}: {error}")

    def _offset(self, name: str, held: HeldObject, now_ns: int, scene: SourceScene, is_new: bool) -> Pose | None:
        """Return the pose of an attached object in the frame of its link; None, after a refusal, if it is not known."""
        robot, frame = self._robot, held.content.frame
        assert robot is not None and robot.robot is not None
        if held.link not in robot.robot.tree.links:
            if is_new:
                scene.refuse(self.name, f"{name:.80}: expected it at a link of {robot.name}, got {held.link!r:.80}")
            return None
        if frame == held.link:
            return held.content.pose
        link = robot.link_motion(held.link, now_ns, scene)
        other: FrameMotion | MissingFrame | None = robot.link_motion(frame, now_ns, scene)
        if other is None:
            other = scene.frames.motion(scene.frame, frame or scene.frame, now_ns)
        if link is None or isinstance(other, MissingFrame):
            if is_new:
                scene.refuse(self.name, f"{name:.80}: {other if link else f'the pose of {held.link} is not known'}")
            return None
        between = link.inverse() @ other
        return Pose(between.position, between.quaternion) @ held.content.pose

    def _carried_rules(self, links: dict[str, int]) -> LinkRules:
        """Return what the scene states about the links of the robot and the attached objects."""
        ids = {name: it.object_id for name, it in self._world.items()}
        ids |= {name: held.object_id for name, held in self._held.items()} | links
        return self._rules.of(links, self._held, ids)
