"""Tests of contacts of plain boxes and balls, against `body_contact`, and of contacts without details."""

from __future__ import annotations

import numpy as np
import pytest

from collision_monitor.errors import ProfileError
from collision_monitor.impact.body_contact import RESULT, ContactQuery, body_contact
from collision_monitor.impact.body_impact import make_scratch
from collision_monitor.monitor.contacts.plain_contacts import plain_contact
from collision_monitor.monitor.monitor import Monitor
from collision_monitor.records import Model
from collision_monitor.settings.profile import Profile
from collision_monitor.shapes.feature_types import UNKNOWN
from collision_monitor.shapes.pose import Pose
from collision_monitor.shapes.registry import Box, Capsule, ConvexHull, Cylinder, Ellipsoid, HalfSpace, Sphere

FEATURES = ("feature_type_a", "feature_type_b", "feature_index_a", "feature_index_b")
POINTS = ("point_a", "point_b", "closing_speed")
BOX = Box((0.5, 0.4, 0.3))
SHAPES = {
    "boxes": [BOX],
    "boxes in two slots each": [[(BOX, Pose()), (Sphere(0.1), Pose((0.2, 0, 0)))], BOX],
    "boxes beside their origin": [[(BOX, Pose((0.1, 0.2, 0.3), (0, 0, 0.6, 0.8)))], BOX],
    "balls": [Sphere(0.2), Sphere(0.3)],
    "others": [BOX, Sphere(0.2), Capsule(0.15, 0.4), Cylinder(0.2, 0.4), ConvexHull(np.eye(4, 3) - 0.25)],
}


def play(shapes, profile: Profile, *, seed: int, **fields):
    """Yield the answers to bodies in a heap; some updates are missing, so that states become older than others."""
    rng = np.random.default_rng(seed)
    n = 40
    monitor = Monitor(profile)
    for i in range(n):
        monitor.add(n - i, shapes[i % len(shapes)], **fields)
    position, linear, angular = rng.uniform(0, 1.1, (n, 3)), rng.normal(size=(n, 3)), rng.normal(size=(n, 3))
    quaternion = rng.normal(size=(n, 4))
    quaternion /= np.linalg.norm(quaternion, axis=1, keepdims=True)
    quaternion[::5] = (0, 0, 0, 1)
    for k in range(8):
        seen = rng.random(n) < (0.7 if k else 1.1)
        poses = np.hstack([position + 0.02 * k * linear, quaternion])
        yield monitor.step(round(2e7 * k), 1 + np.flatnonzero(seen), poses[seen], np.hstack([linear, angular])[seen])


@pytest.mark.parametrize("fields", [{}, {"model": Model.OBB}, {"padding": 0.02}], ids=["exact", "obb", "padding"])
@pytest.mark.parametrize("tolerance", [0.0, 0.05])
@pytest.mark.parametrize("shapes", SHAPES)
def test_without_details_all_other_numbers_are_the_same_bytes(shapes: str, tolerance: float, fields) -> None:
    profile = Profile(distance_tolerance=tolerance, contact_margin=0.01)
    found = 0
    lean = play(SHAPES[shapes], profile.replace(contact_details=False), seed=5, **fields)
    for mine, truth in zip(lean, play(SHAPES[shapes], profile, seed=5, **fields), strict=True):
        assert mine.predictions.tobytes() == truth.predictions.tobytes()
        assert mine.status == truth.status
        for name in truth.contacts.dtype.names:
            if name not in POINTS + FEATURES:
                assert np.array_equal(mine.contact_rows[name], truth.contact_rows[name], equal_nan=True), name
        for name in POINTS:
            assert np.isnan(mine.contact_rows[name]).all()
        for name in FEATURES:
            assert (mine.contact_rows[name] == UNKNOWN).all()
        found += len(mine.contacts)
    assert found > 300


PLAIN = [
    (BOX, {}, True),
    (Sphere(0.2), {}, True),
    (Sphere(0.2), {"padding": 0.02}, True),
    (Ellipsoid((0.2, 0.2, 0.2)), {}, True),  # a ball
    ([(BOX, Pose())], {"static": True, "pose": Pose()}, True),
    (BOX, {"padding": 0.02}, False),
    (BOX, {"model": Model.SPHERE}, False),
    (Capsule(0.15, 0.4), {"model": Model.OBB}, False),
    ([(BOX, Pose((0.1, 0.0, 0.0)))], {}, False),
    ([(Sphere(0.2), Pose((0.0, 0.0, 0.1)))], {}, False),
    ([(BOX, Pose()), (BOX, Pose())], {}, False),
    (Capsule(0.15, 0.4), {}, False),
    (HalfSpace((0, 0, 1), 0.0), {"static": True, "pose": Pose()}, False),
]


def test_plain_bodies_are_single_balls_and_boxes_and_stay_so_in_a_snapshot() -> None:
    monitor = Monitor()
    for i, (shape, fields, _) in enumerate(PLAIN):
        monitor.add(i, shape, **fields)
    expected = [is_plain for *_, is_plain in PLAIN]
    for each in (monitor, Monitor.restored("balanced", monitor.snapshot())):
        slots = [each.roster.slot(i) for i in range(len(PLAIN))]
        assert (each.roster.bodies.plain[slots] != 0).tolist() == expected
    for i, (shape, fields, is_plain) in enumerate(reversed(PLAIN)):
        if not fields.get("static"):
            monitor.add(i, shape, replace=True, **fields)
            assert (monitor.roster.bodies.plain[monitor.roster.slot(i)] != 0) == is_plain


@pytest.mark.parametrize("shape", [BOX, Sphere(0.3)], ids=["boxes", "balls"])
@pytest.mark.parametrize("age", [0.0, 0.1])
def test_contacts_of_plain_bodies_are_the_same_bytes_as_those_of_any(shape: Box | Sphere, age: float) -> None:
    rng = np.random.default_rng(2)
    n = 60
    monitor = Monitor()
    for i in rng.permutation(n).tolist():
        monitor.add(i, shape)
    quaternion = rng.normal(size=(n, 4))
    quaternion[: n // 4] = (0, 0, 0, 1)
    quaternion /= np.linalg.norm(quaternion, axis=1, keepdims=True)
    pose = np.hstack([rng.uniform(0, 1, (n, 3)), quaternion])
    monitor.step(0, np.arange(n), pose, rng.normal(size=(n, 6)))
    multibody, query, scratch = monitor.roster.multibody, ContactQuery(0.01, 1.0), make_scratch()
    plain, truth = np.zeros((2, RESULT))
    found = 0
    for i in range(n):
        for j in range(i):
            if plain_contact(multibody, i, j, age, query, True, scratch, plain):
                assert body_contact(multibody, i, j, age, query, scratch, truth)[0]
                assert plain.tobytes() == truth.tobytes()
                found += 1
    assert found > 300


def test_points_of_contacts_need_details() -> None:
    with pytest.raises(ProfileError, match="contact_points, contact_details: expected contact_points 1 or"):
        Profile(contact_points=4, contact_details=False)


def test_details_that_are_turned_on_are_not_those_of_answers_without_them() -> None:
    monitor = Monitor(Profile(distance_tolerance=0.05, contact_details=False))
    for i in (1, 2):
        monitor.add(i, BOX)
    poses = [(0, 0, 0, 0, 0, 0, 1), (0.45, 0, 0, 0, 0, 0, 1)]
    for k in range(2):
        (row,) = monitor.step(k * 10**7, [1, 2], poses).contacts
        assert np.isnan(row["point_a"]).all()
    monitor.profile = monitor.profile.replace(contact_details=True)
    (row,) = monitor.step(2 * 10**7, [1, 2], poses).contacts
    assert row["point_a"] == pytest.approx((0.25, 0, 0))
    assert row["feature_type_a"] != UNKNOWN
