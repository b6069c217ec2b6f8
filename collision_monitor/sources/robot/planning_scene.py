"""MoveIt's planning scene as a source: static objects of the world, objects that a robot holds, rules for its links.

The world has no speeds, so its objects are static. Only changes are described again: a scene that repeats itself costs
nothing in the monitor. Its octomap is one more object. fixed_frame_transforms are not read.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from typing import Any, Final

from collision_monitor.errors import CollisionMonitorError, InputError
from collision_monitor.objects.description import ObjectDescription
from collision_monitor.robots.urdf import LONGEST_LINK_NAME, MOST_LINKS
from collision_monitor.shapes.pose import Pose
from collision_monitor.sources.ground.frames import MissingFrame, frame_name
from collision_monitor.sources.ground.mapping import Mapping as SourcesFile
from collision_monitor.sources.ground.object_entry import ObjectEntry
from collision_monitor.sources.ground.source import Source
from collision_monitor.sources.ground.source_scene import LONGEST_TEXT, SourceScene
from collision_monitor.sources.messages.octomap_leaves import load_octree_readers, octomap_voxels
from collision_monitor.sources.messages.octomaps import OCCUPIED
from collision_monitor.sources.robot.carried_bodies import Body
from collision_monitor.sources.robot.collision_objects import (
    APPEND,
    REMOVE,
    CollisionObject,
    Parts,
    collision_object,
    has_pose,
    message_pose,
    operation_of,
)
from collision_monitor.sources.robot.link_rules import LinkRules
from collision_monitor.sources.robot.planning_rules import PlanningRules
from collision_monitor.sources.robot.robot_source import RobotSource

PLANNING_SCENE: Final = "moveit_msgs/msg/PlanningScene"
COLLISION_OBJECT: Final = "moveit_msgs/msg/CollisionObject"

OCTOMAP_NAME: Final = "<octomap>"
"""Name of the octomap among the objects of the world, as in MoveIt, also in the matrix of allowed collisions."""

MOST_OBJECTS: Final = 10_000
"""Objects of a planning scene."""

MOST_HELD: Final = 500
"""Attached objects of a robot, each of which may touch all others of its link, 0.3 s. A gripper holds 10."""

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
    """The planning scene of one robot, or of none. describe: makes the descriptions of the world's objects.

    Objects of the world and attached ones are two name spaces, as in MoveIt: both may have one name.
    """

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
        self._ids: dict[tuple[str, int], int] = {}
        self._unusable: set[str] = set()  # objects that are listed because their messages were refused
        self._is_changed = False
        self._waits = False  # whether an object is not placed yet
        load_octree_readers()

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
        """Take a PlanningScene: first what is attached, which may come from the world as it was, then the world."""
        objects = content.world.collision_objects
        named = {str(each.id) for each in objects}
        named |= {OCTOMAP_NAME} if len(content.world.octomap.octomap.data) else set()
        if not content.is_diff:
            for name in sorted(self._unusable - named - {str(each.object.id) for each in _attached(content)}):
                self._unusable.remove(name)
                scene.has(self.name, f"{self.name}/{name}")
            for name in sorted(self._held.keys() - {str(each.object.id) for each in _attached(content)}):
                if self._robot is not None and not content.robot_state.is_diff:
                    self._remove(self._held.pop(name).object_id, name, scene)
        self._take_attached(content, stamp_ns, scene, stays=named if not content.is_diff else ())
        if not content.is_diff:
            for name in sorted(self._world.keys() - named):
                self._drop(name, scene)
        self._is_changed |= self._rules.take(content, scene)
        for each in objects:
            self._change_world(each, scene)
        self._take_octomap(content.world.octomap, scene)

    def _take_attached(self, content: Any, stamp_ns: int, scene: SourceScene, stays: Iterable[str]) -> None:
        attached = _attached(content)
        if self._robot is None:
            if attached:
                text = "expected attached objects in the planning scene of an entry of `robots:`"
                scene.refuse(self.name, text)
                scene.lacks(self.name, f"{self.name}: attached objects", text)
            return
        for each in attached:
            name = str(each.object.id)
            with scene.guard(self.name, name):
                self._change_held(each, name, stamp_ns, scene, leaves_world=name in stays)
                continue
            if name not in self._held and name not in self._world:
                self._lack(name, scene)

    def _take_octomap(self, given: Any, scene: SourceScene) -> None:
        """Take an OctomapWithPose as an object of the world. An empty one says nothing."""
        if not len(given.octomap.data):
            return
        known = self._world.get(OCTOMAP_NAME)
        with scene.guard(self.name, OCTOMAP_NAME):
            voxels = octomap_voxels(given.octomap, OCCUPIED)
            if voxels is None:
                self._drop(OCTOMAP_NAME, scene)
                return
            frame = frame_name(given.header.frame_id or given.octomap.header.frame_id)
            content = CollisionObject(OCTOMAP_NAME, ((voxels, Pose()),), frame, message_pose(given.origin))
            if known is None or known.content.fingerprint != content.fingerprint:
                object_id = known.object_id if known is not None else self._id(OCTOMAP_NAME, None, scene)
                self._world[OCTOMAP_NAME] = WorldObject(object_id, content)
                self._is_changed = True
            return
        if known is None:
            self._lack(OCTOMAP_NAME, scene)

    def _change_world(self, message: Any, scene: SourceScene) -> None:
        name = str(message.id)
        known = self._world.get(name)
        with scene.guard(self.name, name):
            if operation_of(message) == REMOVE:
                for each in [name] if name else list(self._world):
                    self._drop(each, scene)
                return
            content = collision_object(message, known.content if known else None)
            if known is None and len(self._world) >= MOST_OBJECTS:
                raise InputError(f"expected at most {MOST_OBJECTS} objects in the planning scene")
            if known is None or known.content.fingerprint != content.fingerprint:
                held = self._held.get(name)
                taken = None if held is None else held.object_id
                object_id = known.object_id if known is not None else self._id(name, taken, scene)
                self._world[name] = WorldObject(object_id, content)
                self._is_changed = True
            return
        if known is None:
            self._lack(name, scene)

    def _lack(self, name: str, scene: SourceScene) -> None:
        """List an object whose message was refused, until another message has it, or a whole scene does not."""
        scene.lacks(self.name, f"{self.name}/{name}", scene.last_refusal[self.name])
        if len(self._unusable) < MOST_OBJECTS:
            self._unusable.add(name[:LONGEST_TEXT])

    def _drop(self, name: str, scene: SourceScene) -> None:
        """Remove an object of the world, and what the matrix says about it."""
        gone = self._world.pop(name, None)
        if gone is not None:
            self._remove(gone.object_id, name, scene)
        scene.has(self.name, f"{self.name}/{name}")
        if name not in self._held:
            self._rules.forget(name)

    def _remove(self, object_id: int, name: str, scene: SourceScene) -> None:
        scene.remove(object_id)
        scene.has(self.name, f"{self.name}/{name}")
        self._is_changed = True

    def _change_held(self, message: Any, name: str, stamp_ns: int, scene: SourceScene, *, leaves_world: bool) -> None:
        """Attach or detach an object. leaves_world: whether the world keeps an object of that name, if it has one.

        Source: MoveIt, planning_scene.cpp, processAttachedCollisionObjectMsg. Raises InputError, ShapeError, PoseError.
        """
        link, operation = str(message.link_name), operation_of(message.object)
        if operation == REMOVE:
            at_link = [each for each, held in self._held.items() if link in ("", held.link)]
            if name in self._held and name not in at_link:
                raise InputError(f"expected it at the link {self._held[name].link}, got {link!r:.80}")
            for each in [name] if name else at_link:
                self._let_go(each, stamp_ns, scene)
            return
        self._check_link(link)
        solids = message.object.primitives, message.object.meshes, message.object.planes
        known, held = self._world.get(name), self._held.get(name)
        if held is None and len(self._held) >= MOST_HELD:
            raise InputError(f"expected at most {MOST_HELD} attached objects, got more")
        offset, touch = None, _touched(message.touch_links)
        if not any(map(len, solids)) and known is not None:  # an object of the world is picked up
            content = known.content
        elif operation == APPEND and held is not None:
            content = collision_object(message.object, held.content)
            touch = _touched((*touch, *held.touch))
            if not has_pose(message.object.pose):
                offset = held.offset
        else:
            content = collision_object(message.object, held.content if held else None)
        if held is not None and held.content.fingerprint == content.fingerprint:
            if (held.link, held.touch) == (link, touch):
                return
            if operation == APPEND:
                offset = held.offset
        stays = self._world.get(name) if leaves_world else None
        taken = None if stays is None else stays.object_id
        object_id = held.object_id if held is not None else self._id(name, taken, scene)
        if known is not None and not leaves_world:
            del self._world[name]
            if known.object_id != object_id:
                scene.remove(known.object_id)
        self._held[name] = HeldObject(object_id, content, link, touch, offset)
        self._is_changed = True

    def _check_link(self, link: str) -> None:
        """Raise InputError if the robot is known and has no such link: what is there stays as it is."""
        robot = self._robot
        if robot is None or (robot.robot is None and len(link) <= LONGEST_LINK_NAME):
            return
        if robot.robot is None or link not in robot.robot.tree.links:
            raise InputError(_no_link(robot.name, link))

    def _let_go(self, name: str, stamp_ns: int, scene: SourceScene) -> None:
        """Detach an object. It stays in the world where it is, unless the world has another one of its name."""
        held = self._held.pop(name, None)
        if held is None or self._robot is None:
            return
        self._is_changed = True
        with scene.guard(self.name, name):
            if name in self._world:
                scene.remove(held.object_id)
                scene.refuse(self.name, f"{name:.80}: it was detached, and the world has another object of its name")
                return
            if len(self._world) >= MOST_OBJECTS:
                scene.remove(held.object_id)
                raise InputError(f"it was detached, and the world has {MOST_OBJECTS} objects, which is the most")
            link = self._robot.link_motion(held.link, stamp_ns, scene)
            if link is None or held.offset is None:
                scene.remove(held.object_id)
                raise InputError(f"it was detached while the pose of {held.link:.80} was not known")
            try:
                at = Pose(link.position, link.quaternion) @ held.offset
            except CollisionMonitorError:
                scene.remove(held.object_id)
                raise
            self._world[name] = WorldObject(held.object_id, CollisionObject(name, held.content.shapes, scene.frame, at))
            return
        self._lack(name, scene)

    def _id(self, name: str, taken: int | None, scene: SourceScene) -> int:
        """Return the id of an object, which it keeps when it is attached or comes again.

        taken: that of the object of the same name in the other name space.
        """
        if len(self._ids) >= 2 * MOST_OBJECTS:
            used = {it.object_id for it in self._world.values()} | {it.object_id for it in self._held.values()}
            self._ids = {key: i for key, i in self._ids.items() if i in used}
        for key in ((name, 0), (name, 1)):
            if key not in self._ids:
                self._ids[key] = scene.new_id()
            if self._ids[key] != taken:
                break
        return self._ids[key]

    # -- the scene

    def _place(self, now_ns: int, scene: SourceScene, *, is_new: bool) -> None:
        """Describe the objects whose frames are known. is_new: count those whose frames are not."""
        if not (is_new or self._waits or self._is_changed):
            return
        for name, it in self._world.items():
            if it.at is None and scene.may_describe:
                self._place_in_world(name, it, now_ns, scene, is_new)
        robot = self._robot
        self._waits = any(it.at is None for it in self._world.values())
        if robot is None or robot.robot is None:
            return
        for name, held in self._held.items():
            if held.offset is None:
                with scene.guard(self.name, name):
                    held.offset = self._offset(name, held, now_ns, scene, is_new)
                self._is_changed |= held.offset is not None
                self._waits |= held.offset is None
        if self._is_changed:
            self._is_changed = False
            bodies = {
                name: Body(it.object_id, f"{robot.name}/{name}", it.link, it.content.shapes, it.offset, it.touch)
                for name, it in self._held.items()
                if it.offset is not None
            }
            robot.carry(bodies, self._carried_rules(robot, scene), scene)

    def _place_in_world(self, name: str, it: WorldObject, now_ns: int, scene: SourceScene, is_new: bool) -> None:
        what = f"{self.name}/{name}"
        frame = scene.frames.motion(scene.frame, it.content.frame or scene.frame, now_ns)
        if isinstance(frame, MissingFrame):
            if is_new:
                scene.refuse(self.name, f"{name:.80}: {frame}")
            scene.lacks(self.name, what, str(frame))
            return
        with scene.guard(self.name, name):
            it.at = Pose(frame.position, frame.quaternion) @ it.content.pose
            scene.describe(self._describe(it.object_id, what, it.content.shapes, it.at))
            scene.has(self.name, what)
            return
        if it.at is None:  # the place is too far away: it does not come nearer
            it.at = Pose()
        if not scene.is_described(it.object_id):
            scene.lacks(self.name, what, scene.last_refusal[self.name])

    def _offset(self, name: str, held: HeldObject, now_ns: int, scene: SourceScene, is_new: bool) -> Pose | None:
        """Return the pose of an attached object in the frame of its link; None, after a refusal, if it is not known."""
        robot, frame = self._robot, held.content.frame
        assert robot is not None and robot.robot is not None
        what, reason = f"{self.name}/{name}", ""
        link = other = None
        if held.link not in robot.robot.tree.links:
            reason = _no_link(robot.name, held.link)
        elif frame == held.link:
            scene.has(self.name, what)
            return held.content.pose
        else:
            link = robot.link_motion(held.link, now_ns, scene)
            other = robot.link_motion(frame, now_ns, scene)
            if other is None:
                found = scene.frames.motion(scene.frame, frame or scene.frame, now_ns)
                other, reason = (None, str(found)) if isinstance(found, MissingFrame) else (found, "")
            if link is None:
                reason = f"the pose of {held.link:.80} is not known"
        if link is None or other is None:
            if is_new:
                scene.refuse(self.name, f"{name:.80}: {reason}")
            scene.lacks(self.name, what, reason)
            return None
        between = link.inverse() @ other
        scene.has(self.name, what)
        return Pose(between.position, between.quaternion) @ held.content.pose

    def _carried_rules(self, robot: RobotSource, scene: SourceScene) -> LinkRules:
        """Return what the scene states about the links of the robot and the attached objects."""
        ids = [(name, it.object_id) for name, it in self._world.items()]
        ids += [(name, held.object_id) for name, held in self._held.items()]
        ids += robot.link_ids.items()
        with scene.guard(self.name):
            return self._rules.of(robot.link_ids, self._held, ids, robot.disabled)
        return LinkRules()


def _no_link(robot: str, link: str) -> str:
    return f"expected it at a link of {robot}, got {link!r:.80}"


def _touched(names: Iterable[Any]) -> frozenset[str]:
    """Return the names that links may have. Raises InputError for more than there may be links."""
    found = frozenset(str(name) for name in names if len(name) <= LONGEST_LINK_NAME)
    if len(found) > MOST_LINKS:
        raise InputError(f"touch_links: expected at most {MOST_LINKS} links, got {len(found)}")
    return found


def _attached(content: Any) -> Any:
    return content.robot_state.attached_collision_objects
