"""`Robot.motions`: links along their joints. Each tube holds all points of its link, by SciPy's forward kinematics."""

from __future__ import annotations

from math import inf, nan
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from robot_chains import RADIUS, ChainJoint, excess, link_poses, random_chain, sphere_points, stands, urdf_of
from scipy.spatial.transform import Rotation

import collision_monitor as cm
from collision_monitor.errors import InputError, PoseError
from collision_monitor.robots.robot import Description

Array = NDArray[np.float64]
ARM = Path(__file__).parents[2] / "examples/arm/arm.urdf"
MOVING = [0.5, -0.4, 0.3, 0.6, -0.7, 0.6, 0.9, 0.01]
PLACE = [0.0, 0.2, 0.0, -2.0, 0.0, 2.2, 0.785, 0.01]


def robot_of(joints: list[ChainJoint]) -> cm.Robot:
    return cm.Robot(Description(urdf_of(joints, RADIUS), "r.urdf"))


@pytest.mark.parametrize("seed", range(10))
def test_tubes_hold_every_point_of_every_link_of_1000_random_robots(seed: int) -> None:
    rng = np.random.default_rng(seed)
    widest, t = 0.0, np.sort(np.append(rng.uniform(0.0, 2.0, 150), np.linspace(0.0, 2.0, 101)))
    for _ in range(100):
        joints = random_chain(rng, int(rng.integers(1, 9)))
        robot = robot_of(joints)
        rates = rng.normal(size=len(robot.joints)) * rng.choice([0.05, 0.5, 2.0])
        rates[rng.random(len(rates)) < 0.2] = 0.0
        q = dict(zip(robot.joints, rng.uniform(-1.5, 1.5, len(rates)).tolist(), strict=True))
        qd = dict(zip(robot.joints, rates.tolist(), strict=True))
        plans, points = robot.motions(q, qd, 2.0), sphere_points(rng)
        for k, poses in enumerate(link_poses(joints, q, qd, t, stands(t))):
            plan = plans[f"link_{k}"]
            assert (excess(plan, poses, t, points) <= 1e-9).all(), (k, joints, q, qd)
            widest = max(widest, float(plan.tubes.max()))
    assert widest > 0.0


def test_a_tube_is_about_as_wide_as_the_link_is_off() -> None:
    """Not some bound: of the arm of the example, half of the width is used."""
    robot, rng, t = cm.Robot(ARM), np.random.default_rng(1), np.linspace(0.0, 2.0, 400)
    plans = robot.motions(PLACE, MOVING, 2.0)
    wide = [name for name, plan in plans.items() if plan.tubes.max() > 1e-4]
    assert {"hand", "wrist_3", "forearm"} <= set(wide)
    shares = []
    for name in wide:
        r = robot.radii[robot.links.index(name)]
        row = robot.rows[robot.links.index(name)]
        joints = np.stack([np.tile(PLACE, (len(t), 1)) + t[:, None] * MOVING, np.tile(MOVING, (len(t), 1))], axis=2)
        exact = np.array([robot.states(each, np.eye(1, 13, 6)[0])[0][row] for each in joints])
        points = rng.normal(size=(40, 3))
        points *= r / np.linalg.norm(points, axis=1, keepdims=True)
        plan = plans[name]
        off = excess(plan, (exact[:, :3], Rotation.from_quat(exact[:, 3:])), t, points) + plan.tubes[plan.piece(t)]
        assert (off <= plan.tubes[plan.piece(t)] + 1e-9).all()
        shares.append(off.max() / plan.tubes.max())
    assert np.mean(shares) > 0.3


def test_the_first_movable_link_is_on_one_arc_without_a_tube() -> None:
    plans = cm.Robot(ARM).motions(PLACE, MOVING, 2.0)
    first = plans["shoulder"]
    assert (first.between, len(first.times), first.tubes.max()) == ("arc", 2, 0.0)
    assert (plans["base"].tubes.max(), plans["base"].at(1.7).numbers) == (0.0, plans["base"].at(0.0).numbers)


def test_one_joint_alone_moves_all_links_on_arcs() -> None:
    rates = np.zeros(8)
    rates[2] = 1.0
    for name, plan in cm.Robot(ARM).motions(PLACE, rates, 2.0).items():
        assert plan.tubes.max() == 0.0 and len(plan.times) == 2, name


def test_a_joint_stops_at_its_limit() -> None:
    robot = cm.Robot(ARM)
    near = np.array(PLACE)
    near[0] = 2.7  # its limit is 2.8
    rates = np.zeros(8)
    rates[0] = 0.5
    plan = robot.motions(near, rates, 2.0)["hand"]
    at_limit = near.copy()
    at_limit[0] = 2.8
    row = robot.tree.links.index("hand")
    expected = robot.states(np.stack([at_limit, 0.0 * rates], axis=1), np.eye(1, 13, 6)[0])[0][row]
    for t in (0.2, 0.7, 2.0):
        np.testing.assert_allclose(plan.at(t).position, expected[:3], atol=1e-12)
    assert plan.times.tolist() == pytest.approx([0.0, 0.2, 2.0]) and plan.tubes.max() == 0.0


@pytest.mark.parametrize("start", [2.8, 2.9])
def test_a_joint_beyond_its_limit_shows_that_the_limit_does_not_hold(start: float) -> None:
    robot, near, rates = cm.Robot(ARM), np.array(PLACE), np.zeros(8)
    near[0], rates[0] = start, 0.5
    first = robot.motions(near, rates, 2.0)["shoulder"]
    expected = Rotation.from_euler("z", start + 1.0).as_matrix()
    np.testing.assert_allclose(first.at(2.0).rotation, expected, atol=1e-12)


NO_LIMITS = ("", "<limit effort='1'/>", "<limit lower='2' upper='-2'/>", "<limit lower='x' upper='1'/>")


@pytest.mark.parametrize("limit", NO_LIMITS)
def test_a_joint_without_a_usable_limit_goes_on(limit: str) -> None:
    joint = ChainJoint("revolute", 0, np.zeros(3), np.zeros(3), np.array([0.0, 0, 1]))
    text = urdf_of([joint]).replace("</joint>", f"{limit}</joint>")
    plan = cm.Robot(Description(text, "r.urdf")).motions([0.0], [1.0], 2.0)["link_1"]
    np.testing.assert_allclose(plan.at(2.0).rotation, Rotation.from_euler("z", 2.0).as_matrix(), atol=1e-12)


@pytest.mark.parametrize(
    "base",
    [
        cm.Motion((1, 2, 3), (0.5, 0, 0), (0, 0, 0.8), frame="body"),
        cm.Motion((1, 2, 3), (0.5, 0.2, 0), (0.3, 0, 0.8)),
        cm.Motion((1, 2, 3), (0.5, 0.2, 0.1)),
    ],
)
def test_a_base_that_moves_carries_its_links(base: cm.Motion) -> None:
    rng, t = np.random.default_rng(5), np.linspace(0.0, 2.0, 200)
    at = [base.at(each) for each in t]
    moves = np.array([each.position for each in at]), Rotation.from_quat([each.quaternion for each in at])
    for _ in range(30):
        joints = random_chain(rng, 4)
        robot = robot_of(joints)
        q = dict.fromkeys(robot.joints, 0.3)
        qd = dict.fromkeys(robot.joints, 0.6)
        plans, points = robot.motions(q, qd, 2.0, base=base), sphere_points(rng)
        for k, poses in enumerate(link_poses(joints, q, qd, t, moves)):
            assert (excess(plans[f"link_{k}"], poses, t, points) <= 1e-9).all()


def test_wider_tubes_need_fewer_pieces() -> None:
    robot = cm.Robot(ARM)
    counts = []
    for tolerance in (1e-3, 4e-3, 16e-3):
        plans = robot.motions(PLACE, MOVING, 2.0, tolerance=tolerance).values()
        assert max(plan.tubes.max() for plan in plans) <= tolerance
        counts.append(sum(len(plan.times) for plan in plans))
    assert counts[0] > 1.5 * counts[1] > 2.0 * counts[2]


@pytest.mark.parametrize(
    ("q", "qd", "text"),
    [
        ([nan, *PLACE[1:]], MOVING, "q: expected finite numbers up to 1e\\+18, got nan for joint_1"),
        (PLACE, [inf, *MOVING[1:]], "qd: expected finite numbers"),
        (PLACE[:7], MOVING, r"q: expected shape \(8,\), one for each of joint_1.*got \(7,\)"),
        (PLACE, [*MOVING, 1.0], r"qd: expected shape \(8,\)"),
        (PLACE, [1e18, *MOVING[1:]], "qd: expected at most 100000 rad/s or m/s, got 1e\\+18 for joint_1"),
        ({"joint_1": 0.0}, MOVING, "q: expected a number for each of joint_1.*none for joint_2"),
        ({**dict.fromkeys(cm.Robot(ARM).joints, 0.0), "joint_77": 1.0}, MOVING, "unknown: 'joint_77'"),
        ("fast", MOVING, "q: expected 8 numbers"),
        (None, MOVING, "q: expected"),
    ],
)
def test_joints_that_cannot_be_used_are_refused(q: Any, qd: Any, text: str) -> None:
    with pytest.raises(InputError, match=text):
        cm.Robot(ARM).motions(q, qd, 2.0)


@pytest.mark.parametrize(
    ("fields", "text"),
    [
        ({"horizon": 0.0}, "horizon: expected"),
        ({"horizon": nan}, "horizon: expected"),
        ({"horizon": 1e9}, "horizon: expected"),
        ({"tolerance": 0.0}, "tolerance: expected"),
        ({"base": (1, 2)}, "base"),
        ({"base": cm.Motion((0, 0, 0), (1, 0, 0), acceleration=(1, 0, 0))}, "without an acceleration"),
        ({"then": "stop"}, "then: expected one of"),
    ],
)
def test_other_arguments_that_cannot_be_used_are_refused(fields: Any, text: str) -> None:
    with pytest.raises((InputError, PoseError), match=text):
        cm.Robot(ARM).motions(PLACE, MOVING, **{"horizon": 2.0, **fields})


@pytest.mark.parametrize("rate", [10.0, 1e3, 1e5])
def test_rates_that_no_robot_has_are_bounded_or_refused(rate: float) -> None:
    robot, t = cm.Robot(ARM), np.linspace(0.0, 2.0, 50)
    rates = np.full(8, rate)
    try:
        plans = robot.motions(PLACE, rates, 2.0)
    except (InputError, PoseError):
        assert rate > 100.0
        return
    for name, plan in plans.items():
        assert len(plan.times) <= 9 * 64 + 1
        row = robot.tree.links.index(name)
        for each in t:
            at = np.array(PLACE) + rates * each
            at = np.where(np.array(PLACE) < robot.tree.limits[:, 1], np.minimum(at, robot.tree.limits[:, 1]), at)
            exact = robot.states(np.stack([at, rates], axis=1), np.eye(1, 13, 6)[0])[0][row]
            off = np.linalg.norm(exact[:3] - plan.at(each).position)
            assert off <= plan.tubes[plan.piece(each)] + 1e-9


def test_many_joints_that_stop_take_bounded_work() -> None:
    joints = [
        ChainJoint("revolute", k, np.array([0.01, 0, 0]), np.zeros(3), np.array([0.0, 0, 1]), (-1.0, 0.002 * (k + 1)))
        for k in range(600)
    ]
    robot = robot_of(joints)
    with pytest.raises(InputError, match="too many joints stop"):
        robot.motions(np.zeros(600), np.ones(600), 2.0)
