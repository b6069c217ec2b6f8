"""Joint trajectories of a robot's entry: its links follow them as plans, live and from bags, until the joints leave."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from foreign_bag import STORE, write_bag
from foreign_messages import decoder
from numpy.typing import NDArray
from played_sources import JOINT_STATE, JOINTS, MILLISECOND, START, Played, base_row
from ros_messages import SECOND, header, message
from rosbags.typesys import get_types_from_msg
from scipy.interpolate import CubicHermiteSpline

import collision_monitor as cm
from collision_monitor.codec import ObjectTrajectory, decode_predictions
from collision_monitor.codec.trajectories import Then
from collision_monitor.pipeline.topics import Topic
from collision_monitor.records import PredictionStatus
from collision_monitor.session import Session
from collision_monitor.session.replaying.replay import replay
from collision_monitor.session.replaying.replay_report import Verdict
from collision_monitor.sources import import_bag
from collision_monitor.sources.ground.mapping import make_mapping
from collision_monitor.sources.robot.joint_plan import DISPLAY_TRAJECTORY, JOINT_TRAJECTORY

Array = NDArray[np.float64]
ARM = Path(__file__).parents[3] / "examples/arm/arm.urdf"
TOPIC = "/arm_controller/joint_trajectory"
PLANNED: dict[str, Any] = {
    "urdf": str(ARM), "joint_states": "/joint_states", "base": {"pose": [1, 2, 0.5]}, "plan": TOPIC,
}  # fmt: skip
PLACE = np.array([0.0, 0.2, 0.0, -2.0, 0.0, 2.2, 0.785, 0.01])
GOAL = np.array([1.0, 0.5, -0.3, -1.5, 0.2, 2.0, 0.3, 0.01])
POINT, DURATION = "trajectory_msgs/msg/JointTrajectoryPoint", "builtin_interfaces/msg/Duration"
DISPLAY = (
    "string model_id\nmoveit_msgs/RobotTrajectory[] trajectory\n"
    f"{'=' * 80}\nMSG: moveit_msgs/RobotTrajectory\ntrajectory_msgs/JointTrajectory joint_trajectory\n"
    "trajectory_msgs/MultiDOFJointTrajectory multi_dof_joint_trajectory\n"
)


def trajectory(times: Any, positions: Any, velocities: Any = None, names: Any = JOINTS, stamp: int = 0) -> Any:
    points = [
        message(
            POINT,
            positions=np.array(row, float),
            velocities=np.array(() if velocities is None else velocities[k], float),
            time_from_start=message(DURATION, sec=int(t), nanosec=round(t % 1 * 1e9)),
        )
        for k, (t, row) in enumerate(zip(times, positions, strict=True))
    ]
    return message(JOINT_TRAJECTORY, header=header("", stamp), joint_names=list(names), points=points)


def plans_of(played: Played, k: int = -1) -> dict[str, ObjectTrajectory]:
    names = {it.object_id: name for name, it in played.objects.items()}
    return {names[each.object_id]: each for each in played.plans[k].trajectories}


def goes(t: float, t_end: float = 2.0) -> tuple[Array, Array]:
    """Positions and rates on the way from PLACE to GOAL, at rest at both, by SciPy."""
    spline = CubicHermiteSpline([0.0, t_end], [PLACE, GOAL], np.zeros((2, 8)))
    t = min(max(t, 0.0), t_end)
    return spline(t), spline(t, 1)


def started(**entry: Any) -> Played:
    played = Played({**PLANNED, **entry})
    played.joints(START, PLACE, np.zeros(8))
    return played


def send(played: Played, content: Any, kind: str = JOINT_TRAJECTORY, after: int = 10) -> None:
    played.send(TOPIC, kind, content, START + after * MILLISECOND)


def test_links_follow_a_joint_trajectory_to_its_end() -> None:
    played = started()
    send(played, trajectory([2.0], [GOAL], [np.zeros(8)]))
    played.joints(START + 20 * MILLISECOND, *goes(0.01))
    robot, base = cm.Robot(ARM), base_row((1, 2, 0.5))
    plans, at = plans_of(played), played.plans[-1].stamp_ns
    assert {"arm/shoulder", "arm/hand"} <= plans.keys() and plans["arm/hand"].then == Then.REST
    for name, plan in plans.items():
        path = cm.Trajectory(plan.times, plan.poses, between="arc", tube=plan.tube)
        row = robot.tree.links.index(name.removeprefix("arm/"))
        assert 0.0 < plan.tube <= 1.5e-3
        for t in np.linspace(0.0, 2.2, 50):
            joints = np.stack(goes(t + (at - START) * 1e-9 - 0.01), axis=1)
            exact = robot.states(joints, base)[0][row]
            assert np.linalg.norm(path.at(float(t)).position - exact[:3]) <= plan.tube + 1e-6, (name, t)


def test_the_plan_is_told_once_and_ends_with_the_rates_again() -> None:
    played = started()
    send(played, trajectory([2.0], [GOAL], [np.zeros(8)]))
    count = len(played.plans)
    for k in range(1, 120):
        played.joints(START + 20 * k * MILLISECOND, *goes(0.02 * k - 0.01))
    assert played.refusals == []
    told = [each.stamp_ns for each in played.plans]
    assert len(told) <= count + 2, [(each - START) / SECOND for each in told]
    assert (told[-1] - START) / SECOND == pytest.approx(2.22, abs=0.03)  # over, and what is planned ends
    assert {len(each.times) for each in played.plans[-1].trajectories} == {0}


def test_joints_that_leave_the_plan_go_on_at_their_rates() -> None:
    played = started()
    send(played, trajectory([2.0], [GOAL], [np.zeros(8)]))
    played.joints(START + 20 * MILLISECOND, *goes(0.01))
    away = np.array([0.4, 0.3, 0.2, 0.1, 0.3, 0.2, 0.1, 0.0])
    played.joints(START + 40 * MILLISECOND, PLACE - 0.3, away)
    assert any("left the plan: joint_" in each and "is 0.300 rad or m off" in each for each in played.refusals), (
        played.refusals
    )
    assert plans_of(played)["arm/hand"].then == Then.GO_ON
    count = len(played.plans)
    played.joints(START + 60 * MILLISECOND, PLACE - 0.3 + 0.02 * away, away)
    assert len(played.plans) == count  # the plan does not come back


def test_one_that_is_late_within_the_tolerance_keeps_the_plan() -> None:
    played = started()
    send(played, trajectory([2.0], [GOAL], [np.zeros(8)]))
    for k in range(1, 40):
        played.joints(START + 20 * k * MILLISECOND, *goes(0.02 * k - 0.17))
    assert played.refusals == []


def test_a_stamp_says_when_it_starts_and_some_joints_are_enough() -> None:
    played = started()
    two = [[0.5, 0.4], [0.8, 0.6]]
    send(played, trajectory([0.5, 1.0], two, names=JOINTS[:2], stamp=START + SECOND))
    played.joints(START + 20 * MILLISECOND, PLACE, np.zeros(8))
    hand = plans_of(played)["arm/hand"]
    begins = START + SECOND - played.plans[-1].stamp_ns
    assert hand.times[-1] == pytest.approx(1.0 + begins * 1e-9) and hand.times[0] <= 0.0
    played.joints(START + 40 * MILLISECOND, PLACE, np.zeros(8))
    assert played.refusals == []


def test_an_empty_trajectory_ends_the_plan() -> None:
    played = started()
    send(played, trajectory([2.0], [GOAL]))
    played.joints(START + 20 * MILLISECOND, PLACE, np.zeros(8))
    send(played, trajectory([], []), after=30)
    played.joints(START + 40 * MILLISECOND, PLACE, np.zeros(8))
    assert {len(each.times) for each in played.plans[-1].trajectories} == {0}


def test_the_trajectories_of_moveits_message_follow_each_other() -> None:
    decoder().define(DISPLAY_TRAJECTORY, DISPLAY)
    if DISPLAY_TRAJECTORY not in STORE.types:
        STORE.register(get_types_from_msg(DISPLAY, DISPLAY_TRAJECTORY))
    played = started()
    first = trajectory([0.0, 1.0], [PLACE[:7], GOAL[:7]], names=JOINTS[:7])
    second = trajectory([1.0], [[0.03]], names=JOINTS[7:])
    parts = [message("moveit_msgs/msg/RobotTrajectory", joint_trajectory=each) for each in (first, second)]
    send(played, message(DISPLAY_TRAJECTORY, trajectory=parts), DISPLAY_TRAJECTORY)
    played.joints(START + 20 * MILLISECOND, PLACE, np.zeros(8))
    plans = plans_of(played)
    assert plans["arm/left_finger"].times[-1] == pytest.approx(1.99, abs=0.011)
    end = cm.Robot(ARM).states(np.stack([[*GOAL[:7], 0.03], np.zeros(8)], axis=1), base_row((1, 2, 0.5)))[0]
    row = cm.Robot(ARM).tree.links.index("left_finger")
    np.testing.assert_allclose(plans["arm/left_finger"].poses[-1, :3], end[row, :3], atol=1e-9)


BAD = [
    (trajectory([1.0], [[0.0]], names=["door"]), "got 'door'"),
    (trajectory([1.0], [[0.0] * 3]), "positions: expected one for each of 8 joints"),
    (trajectory([1.0, 1.0], [PLACE, GOAL]), "expected rising"),
    (trajectory([1.0], [np.full(8, np.nan)]), "finite"),
    (trajectory([1.0], [np.full(8, 1e9)]), "rad/s or m/s"),
    (trajectory([1.0], [PLACE], stamp=START - 3600 * SECOND), "in the future"),
]


@pytest.mark.parametrize(("content", "text"), BAD)
def test_a_trajectory_that_cannot_be_used_is_refused_and_the_links_go_on(content: Any, text: str) -> None:
    played = started()
    send(played, content)
    assert any(text in each for each in played.refusals), played.refusals
    played.joints(START + 20 * MILLISECOND, PLACE, np.full(8, 0.1))
    assert plans_of(played)["arm/hand"].then == Then.GO_ON


def test_a_trajectory_before_the_joints_are_known_is_refused() -> None:
    played = Played(PLANNED)
    send(played, trajectory([2.0], [GOAL]))
    assert any("before the plan" in each and "joint_1" in each for each in played.refusals), played.refusals


def test_a_bag_with_a_plan_predicts_a_post_beyond_the_joints_rates_and_replays_identically(tmp_path: Path) -> None:
    """At rest at the start, the arm is to swing into a post: only the plan says so."""
    robot = cm.Robot(ARM)
    joints = np.stack([0.5 * (PLACE + GOAL), np.zeros(8)], axis=1)
    there = robot.states(joints, base_row((1, 2, 0.5)))[0][robot.tree.links.index("hand")]
    post = {"static": True, "pose": there[:3].tolist(), "shape": {"sphere": 0.05}}
    messages: list[Any] = [
        (TOPIC, START + 15 * MILLISECOND, (JOINT_TRAJECTORY, trajectory([2.0], [GOAL], [np.zeros(8)])))
    ]
    for k in range(20):
        stamp = START + 10 * k * MILLISECOND
        q, qd = goes(0.01 * k - 0.015)
        content = message(JOINT_STATE, header=header("", stamp), name=JOINTS, position=q, velocity=qd)
        messages.append(("/joint_states", stamp, (JOINT_STATE, content)))
    write_bag(tmp_path / "bag", sorted(messages, key=lambda each: each[1]))
    for plan in (TOPIC, ""):
        entry = {**PLANNED, "plan": plan}
        file = {"frame": "map", "rate": 50, "robots": {"arm": entry}, "objects": {"post": post}}
        path = tmp_path / f"made{bool(plan)}.mcap"
        result = import_bag(tmp_path / "bag", path, make_mapping(file, str(tmp_path / "sources.yaml")))
        assert not result.refused
        session = Session(path)
        answers = [decode_predictions(m.data) for m in session.messages() if m.type == Topic.PREDICTIONS.message]
        early = [each.predictions for each in answers if each.stamp_ns < START + 60 * MILLISECOND]
        hits = [each for each in early if (each["status"] == PredictionStatus.HIT).any()]
        assert bool(hits) is bool(plan)
        assert replay(session).verdict is Verdict.IDENTICAL
