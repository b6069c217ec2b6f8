"""Bounds on the first impacts of meshes (`mesh_impact_tolerance`), against the impacts of a full search."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache

import numpy as np
import pytest

from collision_monitor.monitor.monitor import Monitor
from collision_monitor.motion.stated_motion import Motion
from collision_monitor.query.contact.contact import contact
from collision_monitor.records import PredictionStatus
from collision_monitor.settings.profile import Profile
from collision_monitor.shapes.pose import Pose, from_rotation_vector
from collision_monitor.shapes.registry import Box, Capsule, Cone, Cylinder, Ellipsoid, Mesh, Points, Shape, Sphere
from collision_monitor.world.arm import link

CERTAIN = Profile(uncertainty=False)
COUNT = 16
Predictions = dict[tuple[int, int], np.void]
Shapes = list[Shape | list[tuple[Shape, Pose]]]


@cache
def shapes() -> Shapes:
    rng = np.random.default_rng(2)
    soup = (rng.normal(size=(30, 1, 3)) + 0.3 * rng.normal(size=(30, 3, 3))).reshape(-1, 3) * 0.3
    cloud = Points(rng.normal(size=(40, 3)) * 0.2, 0.02)
    pair: list[tuple[Shape, Pose]] = [(link(0.6, 0.1), Pose((0.4, 0, 0))), (Sphere(0.2), Pose())]
    return [link(0.8, 0.15), Mesh(soup, np.arange(90).reshape(-1, 3)), Box((0.4, 0.3, 0.2)), cloud, pair]


@cache
def with_solids() -> Shapes:
    cone = [(Cone(0.2, 0.5), Pose((0.1, 0, 0), (0, 0.6, 0, 0.8)))]
    cloud, ellipsoid = Points(np.eye(3) * 0.2, 0.02), Ellipsoid((0.3, 0.1, 0.2))
    return [link(0.8, 0.15), Cylinder(0.15, 0.6), cone, shapes()[1], ellipsoid, cloud, Capsule(0.1, 0.4)]


def states(seed: int, slow: float) -> tuple[np.ndarray, np.ndarray]:
    rng = np.random.default_rng(seed)
    position, turn = rng.uniform(-1.5, 1.5, (COUNT, 3)), rng.normal(size=(COUNT, 3))
    linear, angular = rng.normal(size=(COUNT, 3)), rng.normal(size=(COUNT, 3))
    return np.hstack([position, from_rotation_vector(turn)]), slow * np.hstack([linear, angular])


def predicted(profile: Profile, seed: int, slow: float, kinds: Shapes) -> tuple[Predictions, set[tuple[int, int]]]:
    monitor = Monitor(profile)
    for k in range(COUNT):
        monitor.add(k, kinds[k % len(kinds)], padding=0.02 if k == 3 else 0.0)
    result = monitor.step(0, np.arange(COUNT), *states(seed, slow))
    rows = {(int(p["id_a"]), int(p["id_b"])): p for p in result.predictions}
    return rows, {(int(c["id_a"]), int(c["id_b"])) for c in result.contacts}


@cache
def sampled_overlap(kinds: Callable[[], Shapes], seed: int, slow: float, pair: tuple[int, int]) -> float:
    """The first of a few times at which two objects overlap, by contacts of their own; infinite: at none of them.

    The motions are those of `predicted`. A padding would only make the time earlier.
    """
    poses, twists = states(seed, slow)
    motions = [Motion(Pose(poses[k, :3], poses[k, 3:]), twists[k, :3], twists[k, 3:]) for k in pair]
    a, b = (kinds()[k % len(kinds())] for k in pair)
    for time in np.linspace(0.0, CERTAIN.horizon / max(slow, 1.0), 25):
        if contact(a, motions[0].at(time), b, motions[1].at(time)).signed_distance < 0.0:
            return float(time)
    return np.inf


@pytest.mark.parametrize("slow", [0.3, 1.0, 10.0])
@pytest.mark.parametrize("tolerance", [1e-3, 0.1, 10.0])
@pytest.mark.parametrize("kinds", [shapes, with_solids])
def test_bounds_hold_the_impacts(kinds: Callable[[], Shapes], tolerance: float, slow: float) -> None:
    seen = hits = unresolved = 0
    for seed in range(4):
        exact, touching = predicted(CERTAIN, seed, slow, kinds())
        coarse, same = predicted(CERTAIN.replace(mesh_impact_tolerance=tolerance), seed, slow, kinds())
        assert touching == same
        for pair, row in exact.items():
            if row["status"] == PredictionStatus.HIT:
                assert coarse[pair]["lower"] <= min(row["lower"] + 1e-3, row["upper"])
                assert coarse[pair]["upper"] >= row["lower"] - 1e-9
            elif (latest := sampled_overlap(kinds, seed, slow, pair)) < np.inf:
                assert max(coarse[pair]["lower"], row["lower"]) <= latest
                unresolved += 1
            seen += 1
        for pair, row in coarse.items():
            if row["status"] == PredictionStatus.HIT:
                assert pair in exact
                hits += 1
    assert seen > 10 and unresolved > 2
    assert hits > 0.2 * seen


@pytest.mark.parametrize("other", [link(0.8, 0.15), Cylinder(0.15, 0.8), Ellipsoid((0.15, 0.15, 0.4))])
def test_pairs_that_are_due_are_settled(other: Shape) -> None:
    """A link that passes another body at less than the tolerance is UNRESOLVED, until it is near and clear."""
    profile = CERTAIN.replace(mesh_impact_tolerance=0.2, **dict.fromkeys(("position_tolerance",), 1e-6))
    monitor, twist = Monitor(profile), np.array([[0, 0, 0, 0, 0, 0], [1.0, 0, 0, 0, 0, 0]])
    monitor.add(0, other)
    monitor.add(1, link(0.8, 0.15))
    statuses = []
    for k in range(100):
        t = 0.02 * k
        poses = np.array([[0, 0, 0, 0, 0, 0, 1.0], [t - 1.5, 0.32, 0, 0, 0, 0, 1.0]])
        result = monitor.step(round(t * 1e9), [0, 1], poses, twist)
        assert len(result.contacts) == 0
        statuses.append([int(status) for status in result.predictions["status"]])
    assert statuses[0] == [PredictionStatus.UNRESOLVED]
    assert statuses[-1] == []


@pytest.mark.parametrize("kinds", [shapes, with_solids])
def test_a_restored_monitor_gives_the_same_bytes(kinds: Callable[[], Shapes]) -> None:
    profile = Profile.named("fast")
    monitor = Monitor(profile)
    for k in range(COUNT):
        monitor.add(k, kinds()[k % len(kinds())])
    poses, twists = states(1, 1.0)
    other = monitor
    for k in range(40):
        result = monitor.step(20_000_000 * k, np.arange(COUNT), poses, twists)
        if other is not monitor:
            again = other.step(20_000_000 * k, np.arange(COUNT), poses, twists)
            assert again.contact_rows.tobytes() == result.contact_rows.tobytes()
            assert again.predictions.tobytes() == result.predictions.tobytes()
        if k == 15:
            other = Monitor.restored(profile, monitor.snapshot())
        poses[:, :3] += 0.02 * twists[:, :3]
        if k % 7 == 0:
            twists[k % COUNT] *= -1.0
    assert other is not monitor and other.digest == monitor.digest
