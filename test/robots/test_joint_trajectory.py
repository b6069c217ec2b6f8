"""`Robot.follow`: links along joint trajectories. Each tube holds all points of its link, by SciPy's polynomials."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from robot_chains import ChainJoint, excess, link_poses_at, random_chain, sphere_points, stands, urdf_of
from scipy.interpolate import BPoly
from scipy.spatial.transform import Rotation

import collision_monitor as cm
from collision_monitor.errors import InputError
from collision_monitor.robots.robot import Description

Array = NDArray[np.float64]
ARM = Path(__file__).parents[2] / "examples/arm/arm.urdf"
PLACE = [0.0, 0.2, 0.0, -2.0, 0.0, 2.2, 0.785, 0.01]


def exact(times: Array, rows: list[Array], t: Array) -> Array:
    """Positions (T, K) of the spline of the lowest degree through points with derivatives, by SciPy."""
    at = np.clip(t, times[0], times[-1])
    data = np.stack(rows, axis=1)  # (N, derivatives, K)
    return np.asarray(BPoly.from_derivatives(times, data)(at))


def robot_of(joints: list[ChainJoint]) -> cm.Robot:
    return cm.Robot(Description(urdf_of(joints), "r.urdf"))


@pytest.mark.parametrize("degree", [1, 3, 5])
@pytest.mark.parametrize("seed", range(3))
def test_tubes_hold_every_point_of_every_link_of_random_robots(degree: int, seed: int) -> None:
    rng = np.random.default_rng(10 * degree + seed)
    moved = 0.0
    for _ in range(40):
        joints = random_chain(rng, int(rng.integers(1, 9)))
        robot = robot_of(joints)
        count = len(robot.joints)
        if not count:
            continue
        times = np.cumsum(rng.uniform(0.05, 1.5, int(rng.integers(2, 6))))
        rows = [rng.uniform(-1.5, 1.5, (len(times), count)) * rng.choice([0.1, 1.0])]
        rows += [rng.normal(size=(len(times), count)) * s for s in (0.7, 1.5)[: degree // 2]]
        plans = robot.follow(times, *rows)
        t = np.sort(np.append(rng.uniform(times[0], times[-1], 150), times))
        q = dict(zip(robot.joints, exact(times, rows, t).T, strict=True))
        points = sphere_points(rng)
        for k, poses in enumerate(link_poses_at(joints, q, stands(t))):
            plan = plans[f"link_{k}"]
            assert (excess(plan, poses, t, points) <= 1e-9).all(), (k, joints)
            moved = max(moved, float(np.linalg.norm(plan.poses[-1, :3] - plan.poses[0, :3])))
    assert moved > 0.5


def test_tubes_are_as_narrow_as_was_asked() -> None:
    robot, rng = cm.Robot(ARM), np.random.default_rng(2)
    times = np.arange(0.0, 8.0, 2.0)
    rows = [rng.uniform(-1.0, 1.0, (4, 8)) * 0.8 + PLACE, rng.normal(size=(4, 8)) * 0.3, rng.normal(size=(4, 8)) * 0.3]
    for width in (1e-2, 1.5e-3, 2e-4):
        plans = robot.follow(times, *rows, tolerance=width)
        assert max(float(plan.tubes.max()) for plan in plans.values()) <= width
        assert max(len(plan.times) for plan in plans.values()) < 6.0 / 2e-4**0.5


def test_a_long_step_is_followed_in_enough_pieces() -> None:
    plans = cm.Robot(ARM).follow([0.0, 60.0], [PLACE, [2.5, 1.0, 2.0, -0.3, 2.0, 0.5, -2.0, 0.03]], np.zeros((2, 8)))
    assert max(float(plan.tubes.max()) for plan in plans.values()) <= 1.5e-3
    fast = cm.Robot(ARM).follow([0.0, 60.0], [PLACE, PLACE], np.array([[2.0] * 7 + [0.0], [-2.0] * 7 + [0.0]]))
    assert max(float(plan.tubes.max()) for plan in fast.values()) <= 1.5e-3


def test_the_way_to_a_first_point_in_the_future_begins_at_the_joints_now() -> None:
    robot, now = cm.Robot(ARM), dict(zip(cm.Robot(ARM).joints, PLACE, strict=True))
    two = robot.joints[:2]
    plans = robot.follow([1.0], [[0.8, 0.4]], [[0.0, 0.0]], joints=two, q=now, qd=dict.fromkeys(robot.joints, 0.0))
    t = np.linspace(0.0, 1.0, 60)
    between = exact(np.array([0.0, 1.0]), [np.array([[0.0, 0.2], [0.8, 0.4]]), np.zeros((2, 2))], t)
    row = robot.tree.links.index("hand")
    for time, q in zip(t, between, strict=True):
        joints = np.stack([[*q, *PLACE[2:]], np.zeros(8)], axis=1)
        pose = robot.states(joints, np.eye(1, 13, 6)[0])[0][row]
        off = np.linalg.norm(plans["hand"].at(float(time)).position - pose[:3])
        assert off <= plans["hand"].tubes.max() + 1e-9


def test_without_the_joints_now_the_links_rest_at_the_first_point() -> None:
    plan = cm.Robot(ARM).follow([1.0, 2.0], [PLACE, [1.0, *PLACE[1:]]], [[0.5] * 8, [0.0] * 8])["hand"]
    assert plan.times[0] == 1.0 and plan.at(0.0).numbers == plan.at(1.0).numbers


def test_a_continuous_joint_turns_the_short_way() -> None:
    joint = ChainJoint("continuous", 0, np.zeros(3), np.zeros(3), np.array([0.0, 0, 1]))
    robot = robot_of([joint])
    plan = robot.follow([1.0], [[2.0 * np.pi + 0.1]], q=[-0.1])["link_1"]
    np.testing.assert_allclose(plan.at(0.5).rotation, np.eye(3), atol=1e-9)


@pytest.mark.parametrize("scale", [1e-6, 1.0])
def test_a_base_that_moves_carries_its_links(scale: float) -> None:
    robot, base = cm.Robot(ARM), cm.Motion((1, 2, 3), (0.5, 0.2, 0), (0.3, 0, 0.8))
    end = np.array(PLACE) + scale * np.array([1.0, 0.3, -0.5, 0.4, 0.2, 0.1, 0.3, 0.0])
    plans = robot.follow([0.0, 2.0], [PLACE, end], np.zeros((2, 8)), base=base)
    t = np.linspace(0.0, 2.0, 60)
    q = exact(np.array([0.0, 2.0]), [np.stack([PLACE, end]), np.zeros((2, 8))], t)
    for time, now in zip(t, q, strict=True):
        turned = Rotation.from_rotvec(np.array([0.3, 0, 0.8]) * time)
        row = np.concatenate([np.array([1, 2, 3]) + time * np.array([0.5, 0.2, 0]), turned.as_quat(), np.zeros(6)])
        poses = robot.states(np.stack([now, np.zeros(8)], axis=1), row)[0]
        for name, plan in plans.items():
            off = np.linalg.norm(plan.at(float(time)).position - poses[robot.tree.links.index(name), :3])
            assert off <= plan.tubes.max() + 1e-9, name


def test_links_that_no_planned_joint_moves_stand() -> None:
    robot = cm.Robot(ARM)
    plans = robot.follow([0.0, 1.0], [[0.01], [0.03]], joints=[robot.joints[7]], q=PLACE)
    assert plans["forearm"].tubes.max() == 0.0 and len(plans["forearm"].times) == 2
    assert plans["forearm"].at(0.0).numbers == plans["forearm"].at(1.0).numbers


BAD: list[tuple[dict[str, Any], str]] = [
    ({"joints": ["nobody"], "positions": [[0.0], [1.0]]}, "expected joints of the robot .*got 'nobody'"),
    ({"joints": [], "positions": [[], []]}, "each joint once, got none"),
    ({"joints": "joint_1"}, "expected names of joints"),
    ({"joints": ["joint_1", "joint_1"], "positions": [[0, 0], [1, 1]]}, "'joint_1' twice"),
    ({"joints": ["joint_1"], "positions": [[0.0], [1.0]], "q": None}, "positions of all joints now"),
    ({"times": [0.0, 0.0]}, "expected rising"),
    ({"times": [0.0, np.nan]}, "at most 3600 s"),
    ({"times": [0.0, 1e9]}, "at most 3600 s"),
    ({"times": [-2.0, -1.0]}, "in the future"),
    ({"times": [0.0]}, "positions: expected shape"),
    ({"positions": [[0.0] * 8, [np.inf] * 8]}, "finite numbers"),
    ({"positions": [[0.0] * 7, [1.0] * 7]}, "shape"),
    ({"velocities": [[0.0] * 8]}, "velocities: expected shape"),
    ({"accelerations": [[0.0] * 8, [0.0] * 8]}, "expected velocities too"),
    ({"positions": [[0.0] * 8, [1e6] * 8]}, "rad/s or m/s"),
]


@pytest.mark.parametrize(("change", "text"), BAD)
def test_what_is_no_trajectory_of_the_robot_is_refused(change: dict[str, Any], text: str) -> None:
    given: dict[str, Any] = {"times": [0.0, 1.0], "positions": [PLACE, PLACE], "q": PLACE, **change}
    with pytest.raises(InputError, match=text):
        cm.Robot(ARM).follow(**given)
