"""Predicted paths of Autoware: which one is followed, and the tube that holds the others."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from fed import Fed
from foreign_bag import START, T, pose, transforms
from foreign_messages import AUTOWARE, predicted_objects, track
from hypothesis import given
from hypothesis import strategies as st

from collision_monitor import Monitor, Sphere
from collision_monitor.codec.trajectories import Then
from collision_monitor.errors import InputError
from collision_monitor.motion.trajectory import Trajectory
from collision_monitor.records import PredictionStatus
from collision_monitor.sources.plans.predicted_paths import PredictedPath, plan_of_paths

STRAIGHT = [(2.0 * k * 0.5, 0, 0) for k in range(9)]
LEFT = [(2.0 * k * 0.5, 0.25 * (k * 0.5) ** 2, 0) for k in range(9)]


def message(*paths: tuple[float, Any], step: float = 0.5, quaternion: Any = (0, 0, 0, 1)) -> tuple[str, Any]:
    """A pedestrian at the origin with paths (confidence, points)."""
    one = track(1, (0, 0, 0), linear=(2, 0, 0), label=7, predicted=True, kind=1, size=(0.6, 0.6, 1.8))
    duration = T["builtin_interfaces/msg/Duration"](int(step), round(step % 1 * 1e9))
    one.kinematics.predicted_paths = [
        T[AUTOWARE + "PredictedPath"]([pose(p, quaternion) for p in points], duration, confidence)
        for confidence, points in paths
    ]
    return predicted_objects("map", START, one)


def plan_of(*paths: tuple[float, Any], quaternion: Any = (0, 0, 0, 1), step: float = 0.5, **entry: Any) -> Any:
    fed = Fed({"traffic": {"topic": "/t", **entry}})
    fed.give("/t", START, message(*paths, quaternion=quaternion, step=step))
    assert not fed.refused
    return fed.plans[0].trajectories[0] if fed.plans else None


def test_the_likeliest_path_is_followed_and_the_tube_holds_the_others_ahead() -> None:
    plan = plan_of((0.3, LEFT), (0.7, STRAIGHT))
    assert plan.poses[:, :3].tolist() == [list(map(float, p)) for p in STRAIGHT]
    assert plan.times.tolist() == [0.5 * k for k in range(9)]
    assert plan.tube == pytest.approx(0.25 * 3.5**2)  # at the pose behind 1.5 horizons
    assert plan.then == Then.GO_ON


@pytest.mark.parametrize(
    ("paths", "entry", "tube"),
    [
        ([(0.7, STRAIGHT)], {}, 0.0),
        ([(0.7, STRAIGHT), (0.3, LEFT)], {"paths": "likeliest"}, 0.0),
        ([(0.7, STRAIGHT), (0.0005, LEFT)], {}, 0.0),
        ([(0.7, STRAIGHT), (np.nan, LEFT)], {}, 0.25 * 3.5**2),
        ([(0.7, STRAIGHT), (0.3, LEFT[:4])], {}, 0.25 * 1.5**2),  # as far as it goes
        ([(0.7, STRAIGHT), (0.3, LEFT[:1])], {}, 0.0),
    ],
)
def test_which_paths_count(paths: Any, entry: Any, tube: float) -> None:
    plan = plan_of(*paths, **entry)
    assert plan.poses[-1, 0] == 8.0 and plan.tube == pytest.approx(tube)


def test_without_paths_there_is_no_plan_and_one_before_ends() -> None:
    assert plan_of((0.7, STRAIGHT), paths="ignored") is None
    assert plan_of() is None
    fed = Fed({"traffic": {"topic": "/t"}})
    for k, paths in enumerate([[(1.0, STRAIGHT)], [], []]):
        _, content = message(*paths)
        content.header.stamp.nanosec = k
        fed.give("/t", START + k, (AUTOWARE + "PredictedObjects", content))
    assert [[len(plan.times) for plan in each.trajectories] for each in fed.plans] == [[9], [0]]


def test_zeros_are_no_orientation_and_a_turn_widens_the_tube() -> None:
    plan = plan_of((1.0, LEFT), quaternion=(0, 0, 0, 0))
    yaw = 2 * np.arctan2(plan.poses[:, 5], plan.poses[:, 6])
    assert yaw[0] == pytest.approx(np.arctan2(0.0625, 1.0))
    rows = np.zeros((5, 7))
    rows[:, 0], rows[:, 6] = np.arange(5), 1.0
    turned = rows.copy()
    turned[:, 5], turned[:, 6] = np.sin(0.2), np.cos(0.2)
    paths = [PredictedPath(0.6, 0.5, rows), PredictedPath(0.4, 0.5, turned)]
    found = plan_of_paths(paths, 2.0, 3.0, alone=False)
    assert found is not None and found.tube == pytest.approx(3.0 * 2 * np.sin(0.2))


@given(st.integers(0, 100_000))
def test_the_tube_holds_every_path_at_every_time(seed: int) -> None:
    """The oracle samples both paths as trajectories, with the points of the object that are farthest off."""
    rng = np.random.default_rng(seed)
    paths = []
    for k in range(3):
        count, step = int(rng.integers(2, 8)), float(rng.uniform(0.2, 1.0))
        poses = np.zeros((count, 7))
        poses[:, :2] = np.cumsum(rng.normal(0, 0.5, (count, 2)), axis=0)
        half = np.cumsum(rng.normal(0, 0.1, count))
        poses[:, 5], poses[:, 6] = np.sin(half), np.cos(half)
        paths.append(PredictedPath([0.6, 0.3, 0.1][k], step, poses))
    found = plan_of_paths(paths, 2.0, 1.5, alone=False)
    assert found is not None
    plan = Trajectory(found.times, found.poses)
    corners = np.array([(1.5, 0, 0), (0, 1.5, 0), (-1.5, 0, 0), (0, -1.5, 0), (0, 0, 0)])
    for path in paths[1:]:
        other = Trajectory(path.times, path.poses)
        for time in np.linspace(0, min(3.0, found.times[-1], path.times[-1]), 40):
            one, two = plan.at(time), other.at(time)
            a, b = one.position + corners @ one.rotation.T, two.position + corners @ two.rotation.T
            assert np.linalg.norm(a - b, axis=1).max() <= found.tube + 0.02


def test_paths_in_a_frame_of_the_robot_are_brought_into_that_of_the_monitor() -> None:
    fed = Fed({"traffic": {"topic": "/t"}})
    quarter = (0, 0, 0.5**0.5, 0.5**0.5)
    fed.give("/tf", START, transforms(START, ("map", "base", (10, 0, 0), quarter)))
    kind, content = message((1.0, STRAIGHT))
    content.header.frame_id = "base"
    fed.give("/t", START, (kind, content))
    plan = fed.plans[0].trajectories[0]
    assert plan.poses[-1, :3] == pytest.approx([10, 8, 0]) and plan.poses[-1, 3:] == pytest.approx(quarter)


@pytest.mark.parametrize("step", [0.0, -1.0])
def test_a_path_without_a_time_step_is_refused(step: float) -> None:
    fed = Fed({"traffic": {"topic": "/t"}})
    fed.give("/t", START, message((1.0, STRAIGHT), step=step))
    assert not fed.plans and len(fed.rows) == 1
    ((text, _),) = fed.refused.items()
    assert "expected up to 1000 poses and a time step above 0 s" in text


def test_what_another_path_meets_is_unresolved_and_what_none_reaches_is_not_mentioned() -> None:
    """Two posts: one beside the likeliest path on the other one, one on the side where no path leads."""
    plan = plan_of((0.7, STRAIGHT), (0.3, LEFT))
    monitor = Monitor()
    monitor.add(2, Sphere(0.3))
    monitor.add(3, Sphere(0.2), static=True, pose=(3.0, 0.56, 0))
    monitor.add(4, Sphere(0.2), static=True, pose=(3.0, -4.0, 0))
    path = Trajectory(plan.times, plan.poses, then="go on", tube=plan.tube)
    monitor.follow(2, path, stamp_ns=0)
    result = monitor.step(0, [2], [(0, 0, 0, 0, 0, 0, 1)], [(2, 0, 0, 0, 0, 0)])
    assert [(int(row["id_b"]), int(row["status"])) for row in result.predictions] == [(3, PredictionStatus.UNRESOLVED)]


def test_the_key_is_of_predicted_objects_alone() -> None:
    for kind, text in (("TrackedObjects", "does not use it"), ("PredictedObjects", "'some' is unknown")):
        fed = Fed({"traffic": {"topic": "/t", "paths": "some"}})
        assert text in fed.feed.bind("/t", AUTOWARE + kind)["traffic"]
    with pytest.raises(InputError, match="traffic, paths: expected a text"):
        Fed({"traffic": {"topic": "/t", "paths": 3}})
