"""Poses and twists between moving frames equal the ground truth of SciPy's rotations and exponentials."""

from __future__ import annotations

import numpy as np
import pytest
from fed import Fed, in_world
from foreign_bag import SECOND, START, odometry, transforms
from foreign_messages import track, tracked_objects
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from collision_monitor.records import StateFlag
from collision_monitor.sources.ground.frames import HISTORY, FrameMotion, FrameTree, MissingFrame

PERIOD = 20_000_000


def hat(twist: np.ndarray) -> np.ndarray:
    """The 4x4 matrix of a twist (linear, angular)."""
    v, (x, y, z) = twist[:3], twist[3:]
    return np.array([[0, -z, y, v[0]], [z, 0, -x, v[1]], [-y, x, 0, v[2]], [0, 0, 0, 0]])


def exponential(A: np.ndarray) -> np.ndarray:
    """The matrix exponential by its series, for small matrices (SciPy's takes 10 ms on a busy machine)."""
    total = term = np.eye(4)
    for k in range(1, 40):
        term = term @ A / k
        total = total + term
    return total


def pose_of(X: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    return X[:3, 3], Rotation.from_matrix(X[:3, :3]).as_quat()


def random_pose(seed: int) -> np.ndarray:
    X = np.eye(4)
    X[:3, :3] = Rotation.random(random_state=seed).as_matrix()
    X[:3, 3] = np.random.default_rng(seed).uniform(-5, 5, 3)
    return X


def twist_in_world(X_of: object, time: float) -> tuple[np.ndarray, np.ndarray]:
    """Linear and angular velocity of a moving pose, by the exact derivatives of its exponentials."""
    X, dX = X_of(time)  # type: ignore[operator]
    spin = dX[:3, :3] @ X[:3, :3].T
    return dX[:3, 3], np.array([spin[2, 1], spin[0, 2], spin[1, 0]])


class Scene:
    """A robot that drives and turns with a constant twist, a sensor on it, and an object that turns and climbs."""

    def __init__(self, seed: int) -> None:
        rng = np.random.default_rng(seed)
        self.X_WR, self.X_RS, self.X_SO = (random_pose(100 * seed + k) for k in range(3))
        self.robot, self.object = rng.uniform(-1.5, 1.5, (2, 6))

    def robot_at(self, t: float) -> np.ndarray:
        return np.asarray(self.X_WR @ exponential(hat(self.robot) * t))

    def object_at(self, t: float) -> np.ndarray:
        """In the sensor's frame, where it moves with a constant twist of its own."""
        return np.asarray(self.X_SO @ exponential(hat(self.object) * t))

    def truth(self, t: float) -> tuple[np.ndarray, np.ndarray]:
        """X_WO and its derivative."""
        X_WS, X_SO = self.robot_at(t) @ self.X_RS, self.object_at(t)
        dX_WS = self.robot_at(t) @ hat(self.robot) @ self.X_RS
        return X_WS @ X_SO, dX_WS @ X_SO + X_WS @ X_SO @ hat(self.object)


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize("offset", [-7_000_000, 0, 9_000_000])  # within a segment, on a sample, ahead of the last one
def test_a_turning_climbing_object_seen_from_a_turning_driving_robot(seed: int, offset: int) -> None:
    scene = Scene(seed)
    fed = Fed({"thing": {"topic": "/odom", "shape": {"sphere": 1}}})
    fed.give("/tf_static", START, transforms(START, ("robot", "sensor", *pose_of(scene.X_RS))))
    for k in range(40):
        t = k * PERIOD / SECOND
        fed.give("/tf", START, transforms(START + k * PERIOD, ("map", "robot", *pose_of(scene.robot_at(t)))))
        if k >= 2:
            when = k * PERIOD + offset
            p, q = pose_of(scene.object_at(when / SECOND))
            message = odometry("sensor", START + when, p, q, scene.object[:3], scene.object[3:])
            fed.give("/odom", START, message)
            given = fed.steps[-1].states
            row = in_world(given)[0]
            X, _ = scene.truth(when / SECOND)
            linear, angular = twist_in_world(scene.truth, when / SECOND)
            np.testing.assert_allclose(row["position"], X[:3, 3], atol=1e-9)
            np.testing.assert_allclose(Rotation.from_quat(row["quaternion"]).as_matrix(), X[:3, :3], atol=1e-9)
            np.testing.assert_allclose(row["linear"], linear, atol=1e-9)
            np.testing.assert_allclose(row["angular"], angular, atol=1e-9)
            assert row["flags"] == StateFlag.BODY_TWIST
    assert not fed.refused


def test_tracks_seen_from_a_moving_robot_get_their_speed_over_ground() -> None:
    scene = Scene(11)
    fed = Fed({"cars": {"topic": "/tracks"}})
    fed.give("/tf_static", START, transforms(START, ("robot", "sensor", *pose_of(scene.X_RS))))
    for k in range(3):
        t = k * PERIOD / SECOND
        fed.give("/tf", START, transforms(START + k * PERIOD, ("map", "robot", *pose_of(scene.robot_at(t)))))
    when = 2 * PERIOD - 3_000_000
    p, q = pose_of(scene.object_at(when / SECOND))
    fed.give(
        "/tracks", START, tracked_objects("sensor", START + when, track(1, p, q, scene.object[:3], scene.object[3:]))
    )
    linear, angular = twist_in_world(scene.truth, when / SECOND)
    row = in_world(fed.rows)[0]
    np.testing.assert_allclose(row["linear"], linear, atol=1e-9)
    np.testing.assert_allclose(row["angular"], angular, atol=1e-9)


@given(st.integers(0, 10_000), st.floats(0.0, 0.04))
def test_the_inverse_and_products_of_motions_agree(seed: int, time: float) -> None:
    rng = np.random.default_rng(seed)
    tree = FrameTree(1.0)
    stamp = round(time * SECOND)
    for parent, child in (("a", "b"), ("b", "c"), ("a", "d")):
        for k in range(3):
            tree.put(
                parent, child, rng.normal(size=3), Rotation.random(random_state=rng).as_quat(), k * PERIOD, static=False
            )
    down, up, through = tree.motion("d", "c", stamp), tree.motion("c", "d", stamp), tree.motion("a", "c", stamp)
    assert isinstance(down, FrameMotion) and isinstance(up, FrameMotion) and isinstance(through, FrameMotion)
    both = down @ up
    for value, expected in ((both.position, 0), (both.linear, 0), (both.angular, 0), (both.quaternion[:3], 0)):
        np.testing.assert_allclose(value, expected, atol=1e-9)
    a_d = tree.motion("a", "d", stamp)
    assert isinstance(a_d, FrameMotion)
    again = a_d @ down
    np.testing.assert_allclose(again.position, through.position, atol=1e-9)
    np.testing.assert_allclose(again.linear, through.linear, atol=1e-7)


def put(tree: FrameTree, parent: str, child: str, stamp: int, *, static: bool = False, x: float = 0.0) -> str | None:
    return tree.put(parent, child, np.array([x, 0.0, 0.0]), np.array([0.0, 0.0, 0.0, 1.0]), stamp, static=static)


def test_what_is_missing_or_too_old_is_named() -> None:
    tree = FrameTree(0.5)
    put(tree, "map", "odom", 0)
    put(tree, "odom", "base", 10 * SECOND)
    assert (
        str(tree.motion("map", "mars", 0)) == "no transform from 'map' to 'mars'; frames known from tf: base, map, odom"
    )
    text = str(tree.motion("map", "base", 10 * SECOND))
    assert text.startswith("the transform from 'map' to 'odom' is older than the message by more than max_age, 0.5 s")
    assert "'odom' to 'base' is newer than the message" in str(tree.motion("map", "base", 0))
    assert isinstance(tree.motion("odom", "base", 10 * SECOND), FrameMotion)


def test_frames_that_loop_end_the_walk() -> None:
    tree = FrameTree(0.5)
    for parent, child in (("a", "b"), ("b", "c"), ("c", "a")):
        put(tree, parent, child, 0, static=True, x=1.0)
    assert isinstance(tree.motion("map", "a", 0), MissingFrame)
    assert isinstance(tree.motion("a", "c", 0), FrameMotion)
    assert put(tree, "a", "a", 0) == "transform from 'a' to itself"


def test_history_is_bounded_and_restarts() -> None:
    tree = FrameTree(0.5)
    for k in range(100):
        put(tree, "map", "base", k * SECOND, x=float(k))
    oldest = 99 * SECOND - HISTORY
    assert isinstance(tree.motion("map", "base", oldest), FrameMotion)
    assert isinstance(tree.motion("map", "base", oldest - SECOND), MissingFrame)
    put(tree, "map", "wall", 0, static=True)
    tree.restart()
    assert isinstance(tree.motion("map", "base", oldest), MissingFrame)
    assert isinstance(tree.motion("map", "wall", 12345 * SECOND), FrameMotion)


@pytest.mark.parametrize("bad", [(np.nan, 0, 0), (np.inf, 0, 0)])
def test_transforms_that_are_no_poses_are_refused(bad: tuple[float, float, float]) -> None:
    tree = FrameTree(0.5)
    assert "finite" in str(tree.put("a", "b", np.array(bad), np.array([0, 0, 0, 1.0]), 0, static=False))
    assert "unit quaternion" in str(tree.put("a", "b", np.zeros(3), np.zeros(4), 0, static=False))
    assert tree.names == []
