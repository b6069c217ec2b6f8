"""What a gate decides, without topics: arms and bases among objects whose states are given."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from geometry_msgs.msg import PoseStamped
from nav_msgs.msg import Path as PathMessage
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

import collision_monitor as cm
from collision_monitor import records
from collision_monitor.codec import CollisionAlertArray, ObjectDescriptionArray, ObjectStateArray, Removal
from collision_monitor.objects.description import ObjectDescription
from collision_monitor.records import StateFlag
from collision_monitor.robots.kinematic_tree import kinematic_tree
from collision_monitor.robots.urdf import parse_urdf
from collision_monitor.ros.gate.arm_plans import GatedArm, message_at
from collision_monitor.ros.gate.base_plans import base_plan
from collision_monitor.ros.gate.gate_limits import GateLimits
from collision_monitor.ros.gate.gated_plan import RateChange
from collision_monitor.ros.gate.gatekeeper import Gatekeeper, LeftPlanError
from collision_monitor.ros.guard.guard_limits import GuardLimits
from collision_monitor.ros.guard.monitor_answers import ClockReading
from collision_monitor.shapes.registry import Box, Cylinder, HalfSpace, Sphere
from collision_monitor.sources.robot.joint_plan import joint_plan

URDF = Path(__file__).parents[3] / "examples/arm/arm.urdf"
SECOND = 1_000_000_000
START = 1_700_000_000 * SECOND
PLACE = np.array([0.0, 0.2, 0.0, -2.0, 0.0, 2.2, 0.785, 0.01])
SWUNG = np.array([1.5, 0.2, 0.0, -2.0, 0.0, 2.2, 0.785, 0.01])
JOINTS = [*(f"joint_{k}" for k in range(1, 8)), "finger_joint"]


def row(object_id: int, pose: Any, linear: Any = (0, 0, 0), flags: int = 0) -> Any:
    state = np.zeros((), records.STATE)
    state["id"], state["quaternion"], state["flags"] = object_id, (0, 0, 0, 1), flags
    state["position"], state["linear"] = pose[:3], linear
    if len(pose) == 7:
        state["quaternion"] = pose[3:]
    return state


class Scene:
    """A gatekeeper whose monitor answers with whatever is given, at a time that the test moves."""

    def __init__(self, patterns: tuple[str, ...], base: str, **limits: float) -> None:
        self.now_ns = START
        self.keeper = Gatekeeper(patterns, base, "object_monitor", GuardLimits(), GateLimits(**limits))
        self.world = self.keeper.world
        self.step = 0

    @property
    def now(self) -> ClockReading:
        return ClockReading(self.now_ns, self.now_ns * 1e-9)

    def describe(self, *objects: ObjectDescription) -> None:
        self.world.describe(ObjectDescriptionArray(self.now_ns, "world", False, objects))

    def tell(self, *rows: Any, after: float = 0.0, **answer: Any) -> None:
        """States and an answer of the monitor, `after` s from the last ones."""
        self.now_ns += round(after * SECOND)
        states = np.stack(rows) if rows else np.zeros(0, records.STATE)
        self.world.move(ObjectStateArray(self.now_ns, "world", 0, states, np.zeros(0)), self.now.steady)
        self.step += 1
        given = {"monitor": 7, **answer}
        self.keeper.answers.take(
            CollisionAlertArray(self.now_ns, "world", self.step, 0, 0, (), **given), self.now.steady
        )


class ArmScene(Scene):
    """The arm of the example, bolted at the origin."""

    def __init__(self, **limits: float) -> None:
        super().__init__(("arm/*",), "arm/base", **limits)
        self.robot = cm.Robot(URDF)
        self.arm = GatedArm(kinematic_tree(parse_urdf(URDF.read_bytes(), "arm.urdf")), "")
        allowed = self.robot.touching | self.robot.disabled
        ids = {name: 10 + k for k, name in enumerate(self.robot.links)}
        self.ids = ids
        for name, shapes in zip(self.robot.links, self.robot.shapes, strict=True):
            others = tuple(ids[b if a == name else a] for a, b in allowed if name in (a, b))
            is_base = name == "base"
            self.describe(
                ObjectDescription(
                    ids[name], shapes, name=f"arm/{name}", static=is_base, pose=cm.Pose() if is_base else None,
                    allowed=others,
                )
            )  # fmt: skip

    def links(self, q: Any) -> list[Any]:
        poses = self.robot.states(np.stack([q, np.zeros(8)], axis=1), np.eye(1, 13, 6)[0])[0]
        return [
            row(self.ids[name], poses[self.robot.tree.links.index(name)]) for name in self.robot.links if name != "base"
        ]

    def plan(self, message: Any, q: Any = PLACE) -> Callable[[], Any]:
        joints = np.stack([q, np.zeros(8)], axis=1)
        return lambda: self.arm.plan(message, joints, self.world, self.now_ns, self.keeper.limits.start_tolerance)

    def hand(self, q: Any) -> Any:
        poses = self.robot.states(np.stack([q, np.zeros(8)], axis=1), np.eye(1, 13, 6)[0])[0]
        return poses[self.robot.tree.links.index("hand"), :3]


def swing(goal: Any = SWUNG, seconds: float = 3.0, names: Any = JOINTS) -> JointTrajectory:
    point = JointTrajectoryPoint(positions=list(map(float, goal)), velocities=[0.0] * len(goal))
    point.time_from_start.sec, point.time_from_start.nanosec = int(seconds), round(seconds % 1 * 1e9)
    return JointTrajectory(joint_names=list(names), points=[point])


def at(t: float, seconds: float = 3.0) -> Any:
    """Joints of the swing at a time: the cubic that rests at both ends."""
    s = min(max(t / seconds, 0.0), 1.0)
    return PLACE + (3.0 * s**2 - 2.0 * s**3) * (SWUNG - PLACE)


def test_a_swing_goes_through_an_empty_world_and_not_through_a_post() -> None:
    scene = ArmScene()
    scene.tell(*scene.links(PLACE))
    plan, judged = scene.keeper.judge(scene.plan(swing()), scene.now, measures=True)
    assert plan is not None and judged.text == "" and judged.distance == 1.0
    post = scene.hand(at(1.5))
    scene.describe(
        ObjectDescription(1, Cylinder(0.05, 2.0), name="post", static=True, pose=cm.Pose((post[0], post[1], 0.5)))
    )
    plan, judged = scene.keeper.judge(scene.plan(swing()), scene.now, measures=True)
    assert plan is not None and "post" in judged.text, judged
    assert judged.distance == 0.0
    first = judged.conflicts[0]
    assert 0.8 < first.entry[0] <= first.entry[1] < 1.5 < first.exit[0] < 2.5
    assert first.gap == pytest.approx(GateLimits().clearance, abs=2e-3)


def test_the_first_conflict_is_that_of_dense_sampling() -> None:
    scene = ArmScene(clearance=0.0)
    post = scene.hand(at(1.5))
    shape, pose = cm.Cylinder(0.05, 2.0), cm.Pose((post[0], post[1], 0.5))
    scene.describe(ObjectDescription(1, shape, name="post", static=True, pose=pose))
    scene.tell(*scene.links(PLACE))
    _, judged = scene.keeper.judge(scene.plan(swing()), scene.now)

    def touches(t: float) -> bool:
        poses = scene.robot.states(np.stack([at(t), np.zeros(8)], axis=1), np.eye(1, 13, 6)[0])[0]
        for name, shapes in zip(scene.robot.links, scene.robot.shapes, strict=True):
            where = cm.Pose.of_numbers(poses[scene.robot.tree.links.index(name)].tolist())
            if any(cm.contact(s, where @ p, shape, pose).overlaps for s, p in shapes):
                return True
        return False

    times = np.arange(0.0, 3.0, 0.004)
    first = next(float(t) for t in times if touches(float(t)))
    found = judged.conflicts[0].entry
    assert found[0] <= first and first - 0.02 < found[0], (found, first)


@pytest.mark.parametrize("place", [(0.3, 0.3, 1.4), (0.5, -0.5, 0.4)])  # it comes nearer, and it moves away
def test_least_distance_is_kept_and_nearly_reached(place: Any) -> None:
    scene, ball = ArmScene(), cm.Pose(place)
    scene.describe(ObjectDescription(1, Sphere(0.1), name="ball", static=True, pose=ball))
    scene.tell(*scene.links(PLACE))
    plan, judged = scene.keeper.judge(scene.plan(swing()), scene.now, measures=True)
    assert plan is not None
    least = np.inf
    for t in np.linspace(0.0, 3.0, 300):
        poses = scene.robot.states(np.stack([at(float(t)), np.zeros(8)], axis=1), np.eye(1, 13, 6)[0])[0]
        for name, shapes in zip(scene.robot.links, scene.robot.shapes, strict=True):
            if name == "base":  # it stands
                continue
            where = cm.Pose.of_numbers(poses[scene.robot.tree.links.index(name)].tolist())
            gaps = [cm.contact(s, where @ p, Sphere(0.1), ball).signed_distance for s, p in shapes]
            least = min(least, *gaps)
    assert judged.distance <= least <= judged.distance + 6e-3  # a tube, and the step of the search


def test_a_plan_is_judged_beyond_the_horizon_of_a_monitor() -> None:
    scene = ArmScene()
    post = scene.hand(SWUNG)
    scene.describe(
        ObjectDescription(1, Cylinder(0.05, 2.0), name="post", static=True, pose=cm.Pose((post[0], post[1], 0.5)))
    )
    scene.tell(*scene.links(PLACE))
    _, judged = scene.keeper.judge(scene.plan(swing(seconds=60.0)), scene.now)
    assert 30.0 < judged.conflicts[0].entry[0] < 60.0


def test_what_moves_counts_for_as_long_as_it_is_relied_on() -> None:
    for speed, is_clear in ((1.0, True), (0.0, False)):
        scene = ArmScene(ahead=2.0)
        there = scene.hand(at(2.9)) + np.array([5.0 * speed, 0, 0]) * 0.55
        scene.describe(ObjectDescription(1, Sphere(0.1), name="person"))
        scene.tell(*scene.links(PLACE), row(1, there, (-speed, 0, 0)))
        _, judged = scene.keeper.judge(scene.plan(swing()), scene.now)
        assert (judged.text == "") is is_clear, judged.text


def test_a_robot_that_is_too_near_may_part_and_not_come_nearer() -> None:
    scene = ArmScene(clearance=0.08)
    hand = scene.hand(PLACE)
    for way, is_clear in ((-1.0, True), (1.0, False)):
        scene.describe(
            ObjectDescription(
                1, Box((0.1, 0.1, 0.1)), name="box", static=True, pose=cm.Pose(hand + np.array([0, 0.08, 0]))
            )
        )
        scene.tell(*scene.links(PLACE))
        goal = PLACE + way * (SWUNG - PLACE)
        _, judged = scene.keeper.judge(scene.plan(swing(goal)), scene.now)
        assert (judged.text == "") is is_clear, (way, judged.text)
        scene.world.described.pop(1)


def test_links_that_would_meet_each_other_do_not_go_through() -> None:
    """Random goals, and dense sampling of all pairs of links that may not touch."""
    scene, rng, met = ArmScene(), np.random.default_rng(3), 0
    scene.tell(*scene.links(PLACE))
    limits = np.clip(scene.robot.tree.limits, -2.8, 2.8)
    allowed = {frozenset(pair) for pair in scene.robot.touching | scene.robot.disabled}
    shapes = dict(zip(scene.robot.links, scene.robot.shapes, strict=True))
    pairs = [(a, b) for a in shapes for b in shapes if a < b and frozenset((a, b)) not in allowed]

    def meet(q: Any) -> bool:
        poses = scene.robot.states(np.stack([q, np.zeros(8)], axis=1), np.eye(1, 13, 6)[0])[0]
        where = {name: cm.Pose.of_numbers(poses[scene.robot.tree.links.index(name)].tolist()) for name in shapes}
        return any(cm.contact(shapes[a], where[a], shapes[b], where[b]).overlaps for a, b in pairs)

    for _ in range(12):
        goal = np.append(rng.uniform(limits[:7, 0], limits[:7, 1]), 0.01)
        _, judged = scene.keeper.judge(scene.plan(swing(goal)), scene.now)
        assert judged.refused == ""
        s = np.linspace(0.0, 1.0, 40)
        sampled = any(meet(PLACE + (3.0 * t**2 - 2.0 * t**3) * (goal - PLACE)) for t in s.tolist())
        assert not sampled or judged.text, goal
        met += sampled
    assert 0 < met < 12


BAD = [
    (swing(names=["door"], goal=[1.0]), "got 'door'"),
    (swing(SWUNG + 9.0), "the limits of the URDF"),
    (swing([1.0, 2.0]), "positions: expected one for each of 8 joints"),
    (JointTrajectory(joint_names=JOINTS), "at least one"),
    (swing(PLACE + 0.2, 0.0), "point in the future"),
    (swing([np.nan] * 8), "finite"),
]


@pytest.mark.parametrize(("message", "text"), BAD)
def test_a_trajectory_that_cannot_be_followed_is_refused(message: Any, text: str) -> None:
    scene = ArmScene()
    scene.tell(*scene.links(PLACE))
    plan, judged = scene.keeper.judge(scene.plan(message), scene.now)
    assert plan is None and text in judged.refused, judged


def test_one_that_starts_elsewhere_is_refused() -> None:
    message = swing()
    first = JointTrajectoryPoint(positions=[*(PLACE[:7] + 0.3), 0.01], velocities=[0.0] * 8)
    message.points.insert(0, first)
    scene = ArmScene()
    scene.tell(*scene.links(PLACE))
    _, judged = scene.keeper.judge(scene.plan(message), scene.now)
    assert "starts elsewhere: joint_" in judged.refused, judged


def test_a_urdf_without_limits_has_none() -> None:
    scene = ArmScene()
    text = "\n".join(line for line in URDF.read_text().splitlines() if "<limit" not in line)
    scene.arm = GatedArm(kinematic_tree(parse_urdf(text, "arm.urdf")), "")
    scene.tell(*scene.links(PLACE))
    plan, judged = scene.keeper.judge(scene.plan(swing(np.array([4.0, *PLACE[1:]]))), scene.now)
    assert plan is not None, judged


def test_a_load_needs_a_carrier_and_goes_with_it() -> None:
    scene = ArmScene()
    hand = scene.hand(PLACE)
    scene.describe(ObjectDescription(5, Box((0.1, 0.1, 0.1)), name="arm/load", allowed=tuple(scene.ids.values())))
    rows = [*scene.links(PLACE), row(5, hand - [0, 0, 0.25])]
    scene.tell(*rows)
    _, judged = scene.keeper.judge(scene.plan(swing()), scene.now)
    assert "'arm/load' is no link of the URDF" in judged.refused
    scene.arm = GatedArm(scene.arm.tree, "hand")
    plan, judged = scene.keeper.judge(scene.plan(swing()), scene.now)
    assert plan is not None and judged.text == ""
    moved = plan.places(5, np.array([3.0]))[0, :3]
    np.testing.assert_allclose(np.linalg.norm(moved - scene.hand(SWUNG)), 0.25, atol=5e-3)


# -- while it is executed


def executed(
    scene: ArmScene, q_of: Callable[[float], Any], seconds: float, others: Callable[[float], list[Any]]
) -> list[Any]:
    """Follow the swing for some seconds at 20 Hz: [(time, factor, reason)]."""
    scene.tell(*scene.links(PLACE), *others(0.0))
    plan, judged = scene.keeper.judge(scene.plan(swing()), scene.now)
    assert plan is not None and judged.text == "", judged
    scene.keeper.begin(plan, scene.now_ns, timed=True)
    found = []
    for k in range(1, round(seconds * 20) + 1):
        t = 0.05 * k
        scene.tell(*scene.links(q_of(t)), *others(t), after=0.05)
        decision, _ = scene.keeper.decide(scene.now)
        found.append((t, decision.verdict.factor, decision.verdict.reason))
    return found


def test_an_execution_without_obstacles_is_never_slowed() -> None:
    scene = ArmScene()
    found = executed(scene, at, 3.6, lambda t: [])
    assert {factor for _, factor, _ in found} == {1.0}
    assert scene.keeper.execution is not None and scene.keeper.execution.is_over(scene.now_ns)


def test_a_post_that_appears_stops_it_and_it_says_which_pair_when_and_where() -> None:
    scene = ArmScene()
    post = scene.hand(at(1.5))
    scene.describe(ObjectDescription(1, Cylinder(0.05, 2.0), name="post"))
    far = np.array([9.0, 0, 0.5])
    there = np.array([post[0], post[1], 0.5])
    plan_time, factors = 0.0, []
    scene.tell(*scene.links(PLACE), row(1, far))
    plan, _ = scene.keeper.judge(scene.plan(swing()), scene.now)
    assert plan is not None
    scene.keeper.begin(plan, scene.now_ns, timed=True)
    for k in range(1, 80):
        t = 0.05 * k
        execution = scene.keeper.execution
        assert execution is not None
        plan_time = execution.commanded(scene.now_ns + SECOND // 20)
        scene.tell(*scene.links(at(plan_time)), row(1, far if t < 0.5 else there), after=0.05)
        decision, _ = scene.keeper.decide(scene.now)
        factors.append(decision.verdict.factor)
    assert factors[5] == 1.0 and factors[-1] == 0.0
    assert "post" in decision.verdict.reason and "of 3.00 s of the plan" in decision.verdict.reason
    assert plan_time < 1.4
    scene.tell(*scene.links(at(plan_time)), row(1, far), after=0.4)
    decision, change = scene.keeper.decide(scene.now)
    assert decision.verdict.factor == 1.0 and change is not None and change.target == 1.0  # it goes on


def test_without_fresh_answers_it_stops_and_goes_on_with_them() -> None:
    scene = ArmScene()
    executed(scene, at, 0.5, lambda t: [])
    scene.now_ns += SECOND // 2
    decision, change = scene.keeper.decide(scene.now)
    assert decision.fault is not None and change is not None and change.target == 0.0
    assert scene.keeper.decide(scene.now)[1] is None  # told once


def test_two_monitors_stop_it() -> None:
    scene = ArmScene()
    executed(scene, at, 0.5, lambda t: [])
    scene.tell(*scene.links(at(0.55)), after=0.05, monitor=8)
    decision, _ = scene.keeper.decide(scene.now)
    assert decision.fault is not None and "2 monitors" in decision.fault.text


def test_an_object_without_states_stops_it() -> None:
    scene = ArmScene()
    scene.describe(ObjectDescription(1, Sphere(0.1), name="person"))
    person = row(1, (5, 5, 0))
    scene.tell(*scene.links(PLACE), person)
    plan, _ = scene.keeper.judge(scene.plan(swing()), scene.now)
    assert plan is not None
    scene.keeper.begin(plan, scene.now_ns, timed=True)
    for k in range(1, 30):
        scene.tell(*scene.links(at(0.05 * k)), after=0.05)
    decision, _ = scene.keeper.decide(scene.now)
    assert decision.fault is not None and "no state of 'person' for 1." in decision.fault.text


def test_a_snapshot_for_a_new_subscriber_does_not_stop_it() -> None:
    scene = ArmScene()
    scene.describe(ObjectDescription(1, Sphere(0.1), name="person"))
    executed(scene, at, 0.5, lambda t: [row(1, (5, 5, 0))])
    every = tuple(scene.world.described.values())
    scene.world.describe(ObjectDescriptionArray(scene.now_ns, "world", True, every))
    decision, _ = scene.keeper.decide(scene.now)
    assert decision.fault is None and decision.verdict.factor == 1.0, decision


def test_a_robot_whose_objects_change_needs_a_new_plan() -> None:
    for change in (Removal(17), ObjectDescription(5, Sphere(0.1), name="arm/load")):
        scene = ArmScene()
        executed(scene, at, 0.5, lambda t: [])
        scene.world.describe(ObjectDescriptionArray(scene.now_ns, "world", False, (change,)))
        extra = [row(5, (0.5, 0, 0.2))] if isinstance(change, ObjectDescription) else []
        scene.tell(*scene.links(at(0.55)), *extra, after=0.05)
        with pytest.raises(LeftPlanError, match="objects of the robot have changed"):
            scene.keeper.decide(scene.now)


WRONG = [
    (lambda t: PLACE, "has not started for"),
    (lambda t: at(0.35 * t), "late on the plan"),
    (lambda t: at(2.5 * t), "early on the plan"),
    (lambda t: at(t) + np.array([0, 0, 0, 0.6 * min(t, 1.0), 0, 0, 0, 0]), "left the plan: it is 0."),
]


@pytest.mark.parametrize(("q_of", "text"), WRONG)
def test_a_controller_that_does_something_else_is_noticed(q_of: Any, text: str) -> None:
    with pytest.raises(LeftPlanError, match=text):
        executed(ArmScene(), q_of, 3.0, lambda t: [])


def test_one_that_is_a_little_late_is_followed() -> None:
    found = executed(ArmScene(), lambda t: at(t - 0.3), 3.2, lambda t: [])
    assert {factor for _, factor, _ in found} == {1.0}


# -- messages at another rate


def through(fields: int) -> JointTrajectory:
    """A trajectory through five points with positions, velocities and accelerations."""
    rng = np.random.default_rng(fields)
    message = JointTrajectory(joint_names=JOINTS)
    for k in range(1, 6):
        point = JointTrajectoryPoint(
            positions=(PLACE + 0.15 * k * np.array([1, 0.3, -0.4, 0.2, 0.5, -0.3, 0.4, 0])).tolist()
        )
        if fields > 1:
            point.velocities = (0.3 * rng.normal(size=8)).tolist()
        if fields > 2:
            point.accelerations = (0.3 * rng.normal(size=8)).tolist()
        point.time_from_start.sec, point.time_from_start.nanosec = divmod(k * SECOND // 2, SECOND)
        message.points.append(point)
    return message


CHANGES = [(0.3, 1.0, 0.4), (0.6, 0.4, 1.0), (0.9, 1.0, 0.0), (0.35, 1.0, 1.0), (2.45, 0.3, 1.0)]


@pytest.mark.parametrize("fields", [1, 2, 3])
@pytest.mark.parametrize(("begin", "rate", "target"), CHANGES)
def test_a_plan_at_another_rate_goes_through_the_same_joints(
    fields: int, begin: float, rate: float, target: float
) -> None:
    scene = ArmScene()
    scene.tell(*scene.links(PLACE))
    plan, judged = scene.keeper.judge(scene.plan(through(fields)), scene.now)
    assert plan is not None, judged
    change, motion = RateChange(begin, rate, target, 2.0), plan.source.motion
    made = message_at(plan.source, change)
    there = motion.at(np.array([begin]))[0] * (1.0, rate)
    again = joint_plan(made, scene.arm.tree, there, START)
    assert again is not None
    seconds = np.linspace(0.06, float(again.motion.edges[-1]), 200)
    expected = motion.at(np.minimum(change.plan_time(seconds), 2.5))
    found = again.motion.at(seconds)
    np.testing.assert_allclose(found[:, :, 0], expected[:, :, 0], atol=1e-9 if fields == 1 and rate == target else 6e-3)
    end = min(change.end, 2.5) if target == 0.0 else 2.5
    np.testing.assert_allclose(found[-1, :, 0], motion.at(np.array([end]))[0, :, 0], atol=1e-9)
    if target == 0.0 and fields > 1:
        assert not np.array(made.points[-1].velocities).any()


# -- bases


def path_of(points: Any) -> PathMessage:
    made = PathMessage()
    for x, y in points:
        pose = PoseStamped()
        pose.pose.position.x, pose.pose.position.y, pose.pose.orientation.w = float(x), float(y), 1.0
        made.poses.append(pose)
    return made


class CartScene(Scene):
    """A cart with a load on it, on a floor that both may touch."""

    def __init__(self, **limits: float) -> None:
        super().__init__(("cart", "load"), "cart", **limits)
        self.describe(
            ObjectDescription(1, Cylinder(0.3, 0.4), name="cart", allowed=(9, 2)),
            ObjectDescription(2, Box((0.2, 1.2, 0.2)), name="load", allowed=(9, 1)),
            ObjectDescription(9, HalfSpace((0, 0, 1), -0.2), name="floor", static=True, pose=cm.Pose()),
        )

    def cart(self, x: float, y: float = 0.0) -> list[Any]:
        return [row(1, (x, y, 0)), row(2, (x, y, 0.3))]

    def plan(self, message: PathMessage) -> Callable[[], Any]:
        limits = self.keeper.limits
        return lambda: base_plan(message, self.world, 1, self.now_ns, limits.speed, limits.tolerance)


def test_a_base_with_a_load_passes_where_both_fit() -> None:
    scene = CartScene()
    for k, (y, is_clear) in enumerate([(0.9, True), (0.5, False)]):
        scene.describe(
            ObjectDescription(20 + k, Cylinder(0.2, 1.0), name="post", static=True, pose=cm.Pose((2.0, y, 0.3)))
        )
        scene.tell(*scene.cart(0.0))
        plan, judged = scene.keeper.judge(scene.plan(path_of([(0.05 * k, 0) for k in range(80)])), scene.now)
        assert plan is not None and (judged.text == "") is is_clear, judged
    assert judged.conflicts[0].part == "load" and judged.conflicts[0].entry[0] == pytest.approx(1.65, abs=0.05)


def test_a_path_that_ends_or_begins_elsewhere_is_refused() -> None:
    scene = CartScene()
    scene.tell(*scene.cart(0.0))
    for points, text in (
        ([(1.0, 0), (2.0, 0)], "starts elsewhere: the base is 1.000 m off"),
        ([(-1.0, 0), (0.0, 0)], "got its end"),
        ([(0.0, 0)], "expected 2 to"),
        ([(0.0, np.nan), (1.0, 0)], "finite"),
    ):
        plan, judged = scene.keeper.judge(scene.plan(path_of(points)), scene.now)
        assert plan is None and text in judged.refused, judged


def test_a_base_slows_down_stops_and_goes_on() -> None:
    scene = CartScene()
    scene.describe(ObjectDescription(3, Cylinder(0.2, 1.0), name="person"))
    scene.tell(*scene.cart(0.0), row(3, (9, 9, 0)))
    plan, judged = scene.keeper.judge(scene.plan(path_of([(0.05 * k, 0) for k in range(80)])), scene.now)
    assert plan is not None and judged.text == ""
    scene.keeper.begin(plan, scene.now_ns, timed=False)
    x, factor, factors = 0.0, 1.0, []
    for k in range(70):
        x += 0.05 * factor
        scene.tell(*scene.cart(x), row(3, (2.0, 0, 0) if k > 5 else (9, 9, 0)), after=0.05)
        decision, _ = scene.keeper.decide(scene.now)
        factor = decision.verdict.factor
        factors.append(factor)
    gap = 2.0 - x - 0.3 - 0.2
    assert factors[-1] == 0.0 and set(factors) > {0.0, 1.0} and 0.04 < gap < 0.3, (factors, gap)
    assert "cart and person" in decision.verdict.reason
    scene.tell(*scene.cart(x), row(3, (9, 9, 0)), after=0.4)
    assert scene.keeper.decide(scene.now)[0].verdict.factor == 1.0


def test_a_base_that_leaves_its_path_is_stopped() -> None:
    scene = CartScene()
    scene.tell(*scene.cart(0.0))
    plan, _ = scene.keeper.judge(scene.plan(path_of([(0.05 * k, 0) for k in range(80)])), scene.now)
    assert plan is not None
    scene.keeper.begin(plan, scene.now_ns, timed=False)
    scene.tell(*scene.cart(0.2, 0.3), after=0.2)
    with pytest.raises(LeftPlanError, match=r"left the plan: it is 0\.[34]"):
        scene.keeper.decide(scene.now)


def test_a_twist_in_the_body_frame_is_one_of_the_world() -> None:
    scene = CartScene()
    scene.describe(ObjectDescription(3, Cylinder(0.2, 1.0), name="robot_2"))
    turned = (2.0, 0, 0, 0, 0, np.sin(np.pi / 4), np.cos(np.pi / 4))
    scene.tell(*scene.cart(0.0), row(3, turned, (1, 0, 0), StateFlag.BODY_TWIST))
    motion = scene.world.motion(3, scene.now_ns + SECOND // 2)
    assert motion is not None
    np.testing.assert_allclose(motion.pose.position, (2.0, 0.5, 0), atol=1e-9)
