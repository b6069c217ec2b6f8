"""A robot as a source: each link with shapes is an object, moved by the joints and by the base."""

from __future__ import annotations

from collections.abc import Mapping as Table
from contextlib import suppress
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from collision_monitor.errors import InputError, PoseError
from collision_monitor.objects.description import ObjectDescription
from collision_monitor.records import StateFlag
from collision_monitor.robots import link_motions
from collision_monitor.robots.link_plans import load_link_plans
from collision_monitor.robots.robot import Description, Robot, takes_long
from collision_monitor.robots.srdf import Pair
from collision_monitor.shapes.pose import Pose
from collision_monitor.sources.ground.frames import FrameMotion
from collision_monitor.sources.ground.mapping import Mapping
from collision_monitor.sources.ground.solid_shapes import scaled_shape
from collision_monitor.sources.ground.source import Source
from collision_monitor.sources.ground.source_scene import SourceScene
from collision_monitor.sources.robot.carried_bodies import Body, CarriedBodies
from collision_monitor.sources.robot.collision_objects import pose_bytes, shape_digest
from collision_monitor.sources.robot.joint_plan import DISPLAY_TRAJECTORY, JOINT_TRAJECTORY, JointPlan, joint_plan
from collision_monitor.sources.robot.joint_table import JointTable
from collision_monitor.sources.robot.link_rules import LinkRules, allowed_contacts
from collision_monitor.sources.robot.robot_base import BaseMotion, FixedBase, FrameBase, at_links, robot_base
from collision_monitor.sources.robot.robot_entry import JOINTS, RobotEntry
from collision_monitor.sources.robot.robot_plans import OVER, RobotPlans

Floats = NDArray[np.float64]

JOINT_STATE: Final = "sensor_msgs/msg/JointState"
TEXT: Final = "std_msgs/msg/String"

MOST_UNKNOWN_JOINTS: Final = 1000
"""Joints that no robot of the file has, each of which is refused once."""

MOST_DIGESTS: Final = 10_000
"""Bodies whose shapes are known by a digest."""

MOST_IDS: Final = 10_000
"""Links whose ids are kept, also those that another URDF had. A robot has at most 2,000 with shapes."""

_SHOWN: Final = 8

_STDDEVS: Final = ("position_stddev", "orientation_stddev", "velocity_stddev", "angular_velocity_stddev")


class RobotSource(Source):
    """The links of one robot. fleet: all robots of the file, to which the joints of a shared topic may belong."""

    speaks = False  # its URDF comes once; joints that are silent are listed by `settle`

    def __init__(self, entry: RobotEntry, mapping: Mapping, fleet: list[RobotSource]) -> None:
        self.name = entry.name
        self.robot: Robot | None = None
        self.attached: dict[str, Body] = {}
        self._entry = entry
        self._max_age = mapping.max_age
        self._base = robot_base(entry, mapping.frame, mapping.max_age)
        self._joints: JointTable
        self._fleet = fleet
        self._urdf, self._srdf = entry.urdf, entry.srdf
        self._links: dict[str, Body] = {}
        self._ids: dict[str, int] = {}
        self._rules = LinkRules()
        self._described: dict[int, Any] = {}
        self._digests: dict[int, tuple[Any, bytes]] = {}  # of the shapes of the bodies, by their addresses
        self._is_prepared = True  # False while a robot is made beside the monitoring
        self._is_behind = False  # whether bodies wait for their descriptions
        self._place: tuple[float, ...] | None = None  # of a base at rest
        self._standing: dict[int, Pose] = {}  # poses of the links that are rigid with it
        self._moving = CarriedBodies((), ())
        self._needs = np.zeros((0, 0), np.bool_)
        self._plans: RobotPlans | None = None
        self._planned: JointPlan | None = None  # what the joints are to do
        self._unknown_joints: set[str] = set()
        topics: dict[str, tuple[str, ...]] = {
            entry.joint_states: (JOINT_STATE,),
            entry.urdf_topic: (TEXT,),
            entry.srdf_topic: (TEXT,),
            entry.plan: (JOINT_TRAJECTORY, DISPLAY_TRAJECTORY),
        }
        self.topics: Table[str, tuple[str, ...]] = {
            topic: types for topic, types in {**topics, **self._base.topics}.items() if topic
        }
        link_motions.load_link_motions()
        load_link_plans()
        if entry.urdf is not None:
            try:
                self._make(entry.urdf)
            except InputError as error:
                raise InputError(f"{entry.name}, urdf: {error}") from None

    # -- Source

    def begin(self, scene: SourceScene) -> None:
        """See Source."""
        if self.robot is not None:
            self._report_problems(self.robot, scene)
            self._show(scene)

    def take(self, topic: str, content: Any, stamp_ns: int, scene: SourceScene) -> None:
        """See Source."""
        if topic in (self._entry.urdf_topic, self._entry.srdf_topic):
            self._take_text(topic, content.data, scene)
        elif self.robot is None:
            text = f"a message of {topic} came before its URDF on {self._entry.urdf_topic}"
            scene.refuse(self.name, text if self._is_prepared else f"{text} was ready")
        elif topic == self._entry.plan:
            self._take_plan(content, stamp_ns, self.robot)
        elif topic in self._base.topics:
            self._base.take(content, stamp_ns, self.robot, scene)
        else:
            self._refuse_unknown(content.name, scene)
            if (reason := self._joints.take(content, stamp_ns)) is not None:
                scene.refuse(self.name, f"{topic}: {reason}")

    @property
    def frame(self) -> str:
        """The frame of tf that the base is at; empty if there is none, or if it is not known yet."""
        base, robot = self._base, self.robot
        return base.frame(robot) if isinstance(base, FrameBase) and robot is not None else ""

    def moved_by(self, scene: SourceScene) -> str | None:
        """Return the frame whose transforms move the base; None if there is none."""
        return None if self.robot is None else self._base.moved_by(self.robot, scene)

    def restart(self, now_ns: int, scene: SourceScene) -> None:
        """See Source."""
        self._base.restart()
        if self.robot is not None:
            self._joints.restart()
        self.forget_plans()

    def forget_plans(self) -> None:
        """See Source."""
        self._planned = None
        if self._plans is not None:
            self._plans.restart()

    def settle(self, now_ns: int, scene: SourceScene) -> None:
        """See Source. Observes the bodies about which there is news."""
        if not self._is_prepared:
            self._take_prepared(scene)
        if self._is_behind and scene.may_describe:
            self._describe(scene)
        if self.robot is None or not (self._base.fresh or self._joints.fresh.any()):
            return
        base_is_fresh, fresh = self._base.fresh, self._joints.fresh.copy()
        base = self._base.motion(now_ns, self.robot, scene)
        values, known, speed_known = self._joints.at(now_ns)
        if base is None:
            return
        poses, twists = self.robot.states(values, base.row)
        if self._finds_standing(base, poses):
            self._describe(scene)
        due = (self._needs & fresh).any(axis=1) | base_is_fresh
        lacking = self._needs & ~known
        chosen = np.flatnonzero(due & ~lacking.any(axis=1))
        if (due & lacking.any(axis=1)).any():
            names = [self.robot.tree.joints[j] for j in np.flatnonzero(lacking[due].any(axis=0))]
            topic = self._entry.joint_states or "no topic: give `joint_states`"
            more = f" and {len(names) - _SHOWN} more" if len(names) > _SHOWN else ""
            joints = f"{', '.join(names[:_SHOWN])}{more}"
            text = f"expected positions of {joints} on {topic} not older than max_age"
            scene.refuse(self.name, text)
            scene.lacks(self.name, f"{self.name}: joints", text)
        elif not lacking.any():
            scene.has(self.name, f"{self.name}: joints")
        if len(chosen):
            self._observe(chosen, base, poses, twists, speed_known, now_ns, scene)
            self._plan(base, values, known & speed_known, now_ns, scene)

    def _take_plan(self, content: Any, stamp_ns: int, robot: Robot) -> None:
        """Take a plan of the joints, in place of the one before. Raises InputError."""
        fresh = self._joints.fresh.copy()
        values, known, _ = self._joints.at(stamp_ns)
        self._joints.fresh = fresh
        self._planned = None
        plan = joint_plan(content, robot.tree, values, stamp_ns)
        lacking = [name for name, is_known in zip(robot.tree.joints, known, strict=True) if not is_known]
        if plan is not None and lacking:
            more = f" and {len(lacking) - _SHOWN} more" if len(lacking) > _SHOWN else ""
            topic = self._entry.joint_states or "no topic: give `joint_states`"
            raise InputError(
                f"{self._entry.plan}: expected positions on {topic} before the plan, got none of "
                f"{', '.join(lacking[:_SHOWN])}{more}"
            )
        self._planned = plan

    # -- for a planning scene

    @property
    def disabled(self) -> frozenset[Pair]:
        """The pairs of links that the SRDF disables."""
        return frozenset() if self.robot is None else self.robot.disabled

    @property
    def link_ids(self) -> dict[str, int]:
        """The objects of the links with shapes, by the links' names."""
        return {link: body.object_id for link, body in self._links.items()}

    def carry(self, bodies: dict[str, Body], rules: LinkRules, scene: SourceScene) -> None:
        """Carry these bodies, by name, from now on, and no others; use these rules for them and for the links.

        The caller removes the objects that are not carried any more.
        """
        for body in self.attached.values():
            self._described.pop(body.object_id, None)
        self.attached, self._rules = bodies, rules
        self._show(scene)

    def link_motion(self, link: str, now_ns: int, scene: SourceScene) -> FrameMotion | None:
        """Return the motion of a link in the monitor's frame; None if there is no such link or it is not known."""
        if self.robot is None or link not in self.robot.tree.links:
            return None
        row = self.robot.tree.links.index(link)
        fresh, base_is_fresh = self._joints.fresh.copy(), self._base.fresh
        values, known, _ = self._joints.at(now_ns)
        base = self._base.motion(now_ns, self.robot, scene)
        self._joints.fresh, self._base.fresh = fresh, base_is_fresh
        if base is None or not known[self.robot.tree.needs[row]].all():
            return None
        poses, twists = self.robot.states(values, base.row)
        return FrameMotion(poses[row, :3], poses[row, 3:], twists[row, :3], twists[row, 3:], moving=True)

    # -- descriptions

    def _take_text(self, topic: str, text: str, scene: SourceScene) -> None:
        """Take a URDF or an SRDF. A robot that takes long is made beside the monitoring, if the scene has a way."""
        given, is_urdf = Description(text, topic), topic == self._entry.urdf_topic
        known = self._urdf if is_urdf else self._srdf
        if known is not None and known.text == text and self.robot is not None and not self.robot.left_out:
            return
        if is_urdf:
            self._urdf = given
        else:
            self._srdf = given
        if self._urdf is None:
            return
        with scene.guard(self.name):
            if scene.preparation is None or not takes_long(self._urdf, self._srdf, self._entry.packages):
                self._use(self._make(self._urdf), scene)
                return
            scene.preparation.start(self.name, self._urdf, self._srdf, self._entry.packages)
            self._is_prepared = False
            if self.robot is None:
                scene.lacks(self.name, self.name, "its URDF or its meshes are large: it is made beside the monitoring")
            return
        scene.lacks(self.name, self.name, scene.last_refusal[self.name])

    def _take_prepared(self, scene: SourceScene) -> None:
        """Use the robot that was made beside the monitoring, if it is ready."""
        made = None if scene.preparation is None else scene.preparation.ended(self.name)
        if made is None:
            return
        self._is_prepared = True
        with scene.guard(self.name):
            if isinstance(made, str):
                raise InputError(made)
            self._use(self._accept(made), scene)
            return
        scene.lacks(self.name, self.name, scene.last_refusal[self.name])

    def _use(self, robot: Robot, scene: SourceScene) -> None:
        """Show the links of a robot that is new or has changed."""
        for name in [name for name, body in self.attached.items() if body.link not in robot.tree.links]:
            self._forget(self.attached.pop(name), scene)
        scene.has(self.name, self.name)
        self._report_problems(robot, scene)
        self._show(scene)

    def _forget(self, body: Body, scene: SourceScene) -> None:
        scene.remove(body.object_id)
        self._described.pop(body.object_id, None)

    def _report_problems(self, robot: Robot, scene: SourceScene) -> None:
        scene.unmonitored.drop(self.name, f"{self.name}/")
        by_link: dict[str, list[str]] = {}
        for link, problem in robot.left_out:
            scene.refuse(self.name, problem)
            by_link.setdefault(link, []).append(problem)
        for link, texts in by_link.items():
            if link:
                scene.lacks(self.name, f"{self.name}/{link}", "; ".join(texts))

    def _make(self, urdf: Description) -> Robot:
        return self._accept(Robot(urdf, self._srdf, self._entry.packages))

    def _accept(self, robot: Robot) -> Robot:
        """Take over a robot. Raises InputError if the file says more about it than it has."""
        for link in self._entry.allowed:
            if link not in robot.links:
                raise InputError(f"{self.name}, allowed: expected a link with shapes, got {link!r:.80}")
        if self.robot is None or self.robot.tree.joints != robot.tree.joints:
            self._joints, self._planned = JointTable(robot.tree, self._max_age), None
        self.robot = robot
        self._digests.clear()
        return robot

    def _show(self, scene: SourceScene) -> None:
        """Describe the bodies that are new or have changed, and remove the links that are gone."""
        robot = self.robot
        assert robot is not None
        for link in sorted(self._links.keys() - set(robot.links)):
            self._forget(self._links[link], scene)
        if len(self._ids) > MOST_IDS:
            self._ids = {link: object_id for link, object_id in self._ids.items() if link in robot.links}
        for link in robot.links:
            if link not in self._ids:
                self._ids[link] = scene.new_id()
        self._links = {
            link: Body(self._ids[link], f"{self.name}/{link}", link, shapes)
            for link, shapes in zip(robot.links, robot.shapes, strict=True)
        }
        self._base.fresh, self._place = True, None
        self._standing = {}
        if isinstance(self._base, FixedBase):  # its links stand from the start
            base = self._base.motion(0, robot, scene)
            self._finds_standing(base, robot.states(self._joints.at(0)[0], base.row)[0])
            self._base.fresh = True
        self._describe(scene)

    def _describe(self, scene: SourceScene) -> None:
        assert self.robot is not None
        rules, bodies = self._rules, [*self._links.values(), *self.attached.values()]
        allowed = allowed_contacts(self.robot, self._links, self.attached, self._entry.allowed, rules)
        self._is_behind = False
        for body in bodies:
            at = self._standing.get(body.object_id)
            scale = rules.scale.get(body.link, 1.0)  # an attached object has those of its link, as in MoveIt
            padding = self._entry.padding + rules.padding.get(body.link, 0.0)
            facts = scale, padding, allowed[body.object_id], at and pose_bytes(at), self._digest(body)
            if self._described.get(body.object_id) == facts:
                continue
            if not scene.may_describe:
                self._is_behind = True
                break
            with scene.guard(self.name, body.name):
                scene.describe(self._description(body, scale, padding, allowed[body.object_id], at))
                self._described[body.object_id] = facts
                scene.has(self.name, body.name)
                continue
            if body.object_id not in self._described:
                scene.lacks(self.name, body.name, scene.last_refusal[self.name])
        moving = [it for it in bodies if it.object_id in self._described and it.object_id not in self._standing]
        self._moving = CarriedBodies(moving, self.robot.tree.links)
        self._needs = self.robot.tree.needs[self._moving.rows]
        padding = self._entry.padding + max(rules.padding.values(), default=0.0)
        self._plans = RobotPlans(self.robot.tree, moving, padding, rules.scale, self._plans)

    def _digest(self, body: Body) -> bytes:
        """Return what is equal for equal shapes, computed once for each."""
        known = self._digests.get(id(body.shapes))
        if known is None:
            if len(self._digests) > MOST_DIGESTS:
                self._digests.clear()
            known = self._digests[id(body.shapes)] = body.shapes, shape_digest(body.shapes)
        return known[1]

    def _description(
        self, body: Body, scale: float, padding: float, allowed: tuple[int, ...], at: Pose | None
    ) -> ObjectDescription:
        entry = self._entry
        return ObjectDescription(
            body.object_id,
            [(shape if scale == 1.0 else scaled_shape(shape, scale), pose) for shape, pose in body.shapes],
            name=body.name,
            static=at is not None,
            pose=at,
            group=entry.group,
            mask=entry.mask,
            padding=padding,
            model=entry.model,
            allowed=allowed,
        )

    # -- states

    def _finds_standing(self, base: BaseMotion, poses: Floats) -> bool:
        """Find the bodies that are rigid with a base at rest, which are static objects. Return whether it changed."""
        assert self.robot is not None
        place = None if base.motion.moving else (*base.motion.position, *base.motion.quaternion)
        if place == self._place:
            return False
        self._place = place
        self._standing = {}
        for body in (*self._links.values(), *self.attached.values()) if place is not None else ():
            row = self.robot.tree.links.index(body.link)
            if not self.robot.tree.needs[row].any():
                with suppress(PoseError):  # too far away; the states of such a link are refused
                    self._standing[body.object_id] = Pose(poses[row, :3], poses[row, 3:]) @ body.offset
        return True

    def _observe(
        self,
        chosen: NDArray[np.intp],
        base: BaseMotion,
        poses: Floats,
        twists: Floats,
        speed_known: NDArray[np.bool_],
        now_ns: int,
        scene: SourceScene,
    ) -> None:
        states = self._moving.states(poses, twists)[chosen]
        if base.stddev.any():
            stddevs = at_links(base, states["position"] - base.motion.position)
            for field_name, column in zip(_STDDEVS, stddevs.T, strict=True):
                states[field_name] = column
        unknown = (self._needs[chosen] & ~speed_known).any(axis=1) | (not base.motion.twist_known)
        states["flags"][unknown] |= np.uint32(StateFlag.TWIST_UNKNOWN)
        scene.observe(self.name, states, now_ns, turns=True)

    def _plan(
        self, base: BaseMotion, values: Floats, known: NDArray[np.bool_], now_ns: int, scene: SourceScene
    ) -> None:  # fmt: skip
        """Let the bodies follow the joints at their rates. The errors of a base that has some count on arcs only."""
        assert self._plans is not None
        usable: NDArray[np.bool_] = np.asarray(~(self._needs & ~known).any(axis=1))
        if base.stddev.any() or not base.motion.twist_known or self._entry.motion != JOINTS:
            usable[:] = False
        planned = self._planned
        if planned is not None and (reason := self._plans.leaves(planned, now_ns, values)):
            self._planned = planned = None
            if reason != OVER:
                scene.refuse(self.name, f"{self._entry.plan}: {reason}")
        with scene.guard(self.name, "plans"):
            scene.follow(self._plans.due(now_ns, values, base.row, usable, scene.horizon, planned), now_ns)

    def _refuse_unknown(self, names: Any, scene: SourceScene) -> None:
        """Count each joint once that no robot of the file has."""
        assert self.robot is not None
        for name in names:
            if name not in self.robot.known_joints and name not in self._unknown_joints:
                if len(self._unknown_joints) >= MOST_UNKNOWN_JOINTS:
                    return
                self._unknown_joints.add(name[:256])
                if not any(other.robot is not None and name in other.robot.known_joints for other in self._fleet):
                    topic = self._entry.joint_states
                    scene.refuse(self.name, f"expected joints of its URDF on {topic}, got {name!r:.80}")
