"""Contacts with several points: places and velocities; nothing else depends on the number of points."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from numpy.typing import NDArray
from started_threads import StartedThreads

from collision_monitor import records
from collision_monitor.monitor.monitor import Monitor
from collision_monitor.monitor.result import StepResult
from collision_monitor.records import ContactStatus, Model, Phase
from collision_monitor.settings.profile import Profile
from collision_monitor.shapes.pose import Pose, from_rotation_vector, multiply
from collision_monitor.shapes.registry import Box, Capsule, ConvexHull, HalfSpace, Polygon, Sphere
from collision_monitor.world import make_scene

BOX = Box((0.8, 0.6, 0.4))
CORNERS = np.array([[x, y, z] for x in (-0.4, 0.4) for y in (-0.3, 0.3) for z in (-0.2, 0.2)])
FOUR = Profile(contact_points=4)


def rows_of(result: StepResult, a: int, b: int) -> NDArray[np.void]:
    """Rows of one pair; checks their numbers, that only the points differ, and that the points fit together."""
    rows = result.contact_rows[(result.contact_rows["id_a"] == a) & (result.contact_rows["id_b"] == b)]
    assert rows["point_index"].tolist() == list(range(len(rows)))
    assert set(rows["point_count"].tolist()) <= {len(rows)}
    for name in rows.dtype.names:
        if name not in ("point_a", "point_b", "closing_speed", "point_index"):
            assert np.array_equal(rows[name], np.repeat(rows[name][:1], len(rows), axis=0), equal_nan=True)
    on_b = rows["point_a"] + rows["signed_distance"][:, None] * rows["normal"]
    np.testing.assert_allclose(rows["point_b"], on_b, rtol=1e-15, atol=1e-12)
    return rows


def assert_same_points(found: NDArray[np.float64], expected: NDArray[np.float64], atol: float) -> None:
    assert len(found) == len(expected)
    apart = np.linalg.norm(found[:, None] - expected[None], axis=-1)
    assert apart.min(axis=1).max() < atol
    assert sorted(apart.argmin(axis=1)) == list(range(len(expected)))


@pytest.mark.parametrize("far", [0.0, 1e5])
@pytest.mark.parametrize("ground", ["half-space", "box", "tiles", "hull"])
def test_a_box_lies_on_its_four_corners(ground: str, far: float) -> None:
    """However the box and its ground are turned together; each corner closes at its own speed."""
    rng = np.random.default_rng(3)
    slab = Box((4, 4, 1))
    below = [[x, y, z] for x in (-2, 2) for y in (-2, 2) for z in (-0.5, 0.5)]
    tiles = [(Box((1, 1, 1)), Pose((x, y, -0.5))) for x in (-1.5, -0.5, 0.5, 1.5) for y in (-1.5, -0.5, 0.5, 1.5)]
    shape = {
        "half-space": HalfSpace((0, 0, 1)),
        "box": [(slab, Pose((0, 0, -0.5)))],
        "tiles": tiles,
        "hull": [(ConvexHull(np.array(below)), Pose((0, 0, -0.5)))],
    }[ground]
    for _ in range(5):
        q = rng.normal(size=4)
        floor = Pose(far * rng.uniform(-1, 1, 3), q / np.linalg.norm(q))
        turn = rng.uniform(0, 7)
        lying = floor @ Pose((0.3, -0.2, 0.19), (0, 0, np.sin(turn / 2), np.cos(turn / 2)))
        monitor = Monitor(FOUR)
        monitor.add(1, shape, static=True, pose=floor)
        monitor.add(2, BOX)
        twist = rng.uniform(-1, 1, 6)
        pose = [*lying.position, *lying.quaternion]
        rows = rows_of(monitor.step(0, [2], [pose], [twist]), 1, 2)
        feet = CORNERS[CORNERS[:, 2] < 0] @ lying.rotation.T + lying.position
        assert_same_points(rows["point_b"], feet, 1e-9 + 1e-15 * far)
        np.testing.assert_allclose(rows["signed_distance"], -0.01, atol=1e-12 + 1e-15 * far)
        for row in rows:  # closing speed of the corner, by a finite difference
            dt = 1e-6
            turned = multiply(from_rotation_vector(twist[3:] * dt), lying.quaternion)
            later = Pose(lying.position + twist[:3] * dt, turned)
            foot = (row["point_b"] - lying.position) @ lying.rotation
            deeper = (foot @ later.rotation.T - foot @ lying.rotation.T + twist[:3] * dt) @ -row["normal"]
            assert row["closing_speed"] == pytest.approx(deeper / dt, abs=1e-4)


def test_a_cart_stands_on_its_wheels_and_a_polygon_on_its_edge() -> None:
    monitor = Monitor(FOUR)
    wheels = [(Sphere(0.1), Pose((x, y, 0.1))) for x in (-0.5, 0.5) for y in (-0.3, 0.3)]
    monitor.add(1, HalfSpace((0, 0, 1)), static=True, pose=Pose())
    monitor.add(2, [*wheels, (Box((1.2, 0.8, 0.2)), Pose((0, 0, 0.3)))])
    monitor.add(3, Capsule(0.2, 1.0))
    result = monitor.step(0, [2, 3], [[1, 2, 0, 0, 0, 0, 1], [9, 0, 0.7, 0, 0, 0, 1]])
    expected = np.array([[1 + x, 2 + y, 0] for x in (-0.5, 0.5) for y in (-0.3, 0.3)])
    assert_same_points(rows_of(result, 1, 2)["point_a"], expected, 1e-12)
    assert len(rows_of(result, 1, 3)) == 1
    assert result.status.contacts == 2

    plane = Monitor(FOUR)
    plane.add(1, Polygon([(0, 0), (2, 0), (2, 1), (1, 1), (1, 2), (0, 2)]), static=True, pose=Pose())
    plane.add(2, Polygon([(-0.5, -0.5), (0.5, -0.5), (0.5, 0.5), (-0.5, 0.5)]))
    rows = rows_of(plane.step(0, [2], [[1.7, 1.49, 0, 0, 0, 0, 1]]), 1, 2)
    assert_same_points(rows["point_a"], np.array([[1.2, 1, 0], [2, 1, 0]]), 1e-12)


@pytest.mark.parametrize("most", [1, 2, 3, 4])
def test_as_many_points_as_wanted_and_nothing_else_changes(most: int, started_threads: StartedThreads) -> None:
    scene = make_scene("clutter", objects=150)
    monitor, one = Monitor(Profile(contact_points=most, threads=2)), Monitor()
    for description in scene.descriptions:
        monitor.describe(description)
        one.describe(description)
    monitor.add(9000, Box((100, 100, 1)), static=True, pose=Pose((0, 0, -50)))
    one.add(9000, Box((100, 100, 1)), static=True, pose=Pose((0, 0, -50)))
    monitor.add(9001, BOX)
    one.add(9001, BOX)
    seen = set()
    for step in range(20):
        states = np.concatenate([scene.step(), np.zeros(1, records.STATE)])
        states[-1]["id"], states[-1]["quaternion"] = 9001, (0, 0, 0, 1)
        states[-1]["position"] = (0, 0, -49.31 if 4 <= step < 12 else -40)
        mine, expected = (each.step(step * 20_000_000, states) for each in (monitor, one))
        first = mine.contact_rows[mine.contact_rows["point_index"] == 0]
        for name in first.dtype.names:
            if name not in ("point_a", "point_b", "closing_speed", "point_count"):
                assert np.array_equal(first[name], expected.contact_rows[name], equal_nan=True)
        assert np.array_equal(mine.predictions.view(np.uint8), expected.predictions.view(np.uint8))
        assert mine.status == expected.status
        if most == 1:
            assert np.array_equal(mine.contact_rows.view(np.uint8), expected.contact_rows.view(np.uint8))
        lying = rows_of(mine, 9000, 9001)
        phase = {4: Phase.BEGIN, 12: Phase.END}.get(step, Phase.PERSIST)
        assert len(lying) == (most if 4 <= step < 12 else step == 12)
        assert set(lying["phase"].tolist()) <= {phase}
        if most == 2:
            assert all(np.linalg.norm(a - b) == pytest.approx(1.0) for a, b in pairwise(lying["point_a"]))
        seen |= set(mine.contact_rows["point_count"].tolist())
    assert seen == {1, most}
    assert started_threads.most == 2, "those of the monitor with more points"


def test_what_is_not_settled_has_one_point() -> None:
    """A model that touches although the object may not; pairs deferred for lack of time."""
    monitor = Monitor(FOUR)
    monitor.add(1, HalfSpace((0, 0, 1)), static=True, pose=Pose())
    monitor.add(2, ConvexHull([[0, 0, 0.5], [1, 0, -0.5], [-1, 0, -0.5], [0, 1, -0.5]]), model=Model.AABB)
    (row,) = rows_of(monitor.step(0, [2], [[0, 0, 0.49, 0, 0, 0, 1]]), 1, 2)
    assert row["status"] == ContactStatus.UNRESOLVED

    late = Monitor(FOUR.replace(pairs_per_step=1))
    ids = list(range(40))
    for k in ids:
        late.add(k, Box((1, 1, 1)))
    poses = np.zeros((40, 7))
    poses[:, 0], poses[:, 6] = 0.99 * np.arange(40), 1.0
    counts = set()
    for step in range(12):
        contacts = late.step(step * 10_000_000, ids, poses).contacts
        unsettled = contacts["status"] == ContactStatus.UNRESOLVED
        assert (contacts["point_count"][unsettled] == 1).all()
        counts |= {(bool(u), int(n)) for u, n in zip(unsettled, contacts["point_count"], strict=True)}
    assert counts == {(True, 1), (False, 4)}
