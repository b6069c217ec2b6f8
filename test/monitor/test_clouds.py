"""The monitor with clouds: contacts as `contact` finds them, replaced at every step, over the wire, restored."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh
from scipy.spatial.transform import Rotation

import collision_monitor as cm
from collision_monitor.codec import decode_descriptions, encode_descriptions
from collision_monitor.monitor.monitor import Monitor
from collision_monitor.monitor.state.snapshot import Snapshot
from collision_monitor.objects.description import ObjectDescription
from collision_monitor.pipeline.pipeline import Pipeline
from collision_monitor.pipeline.preparation import Preparation
from collision_monitor.records import STATE, ContactStatus, Model, PredictionStatus
from collision_monitor.settings.profile import Profile
from collision_monitor.shapes.kinds.points import MOST_CLOUD_POINTS

SECOND = 1_000_000_000
TORUS = trimesh.creation.torus(1.0, 0.35, major_sections=14, minor_sections=8)
OTHERS = [
    cm.Sphere(0.4),
    cm.Box((0.5, 0.7, 0.4)),
    cm.Cone(0.3, 0.8),
    cm.ConvexHull(np.random.default_rng(1).normal(size=(12, 3)) * 0.35),
    cm.Mesh(TORUS.vertices, TORUS.faces),
]


def random_pose(rng: np.random.Generator, far: float) -> cm.Pose:
    return cm.Pose(far * rng.normal(size=3), Rotation.random(rng=rng).as_quat())


def row_of(pose: cm.Pose) -> list[float]:
    return [*pose.position, *pose.quaternion]


@pytest.mark.parametrize("other", OTHERS, ids=lambda shape: type(shape).__name__)
def test_contacts_and_impacts_with_a_cloud_that_each_step_replaces(other):
    rng = np.random.default_rng(3)
    monitor = Monitor(Profile(contact_margin=10.0))
    monitor.add(1, other)
    overlapping = 0
    for step in range(8):
        cloud = cm.Points(rng.normal(size=(100 + step, 3)), 0.03)
        X, Y = random_pose(rng, 0.5), random_pose(rng, 1.0)
        monitor.add(2, cloud, static=True, pose=Y, replace=step > 0)
        (row,) = monitor.step((1 + step) * SECOND, [1], [row_of(X)]).contacts
        truth = cm.contact(other, X, cloud, Y)
        assert row["signed_distance"] == pytest.approx(truth.signed_distance, abs=1e-9)
        assert row["model_b"] == Model.EXACT and row["status"] == ContactStatus.TOUCHING
        assert row["feature_type_b"] == 1 and row["feature_index_b"] < len(cloud.points)
        at = cloud.points[row["feature_index_b"]] @ Y.rotation.T + Y.position
        assert np.linalg.norm(at - row["point_b"]) == pytest.approx(0.03, abs=1e-9)
        overlapping += bool(truth.overlaps)
        if truth.overlaps:  # a translation along the normal parts them
            apart = row["error_bound"] - row["signed_distance"] + 1e-6
            assert not cm.overlap(other, X, cloud, cm.Pose(Y.position + apart * row["normal"], Y.quaternion))
    assert overlapping


def test_predictions_with_a_cloud_are_certified():
    rng = np.random.default_rng(4)
    cloud = cm.Points(0.7 * rng.normal(size=(80, 3)), 0.03)
    monitor = Monitor(Profile(horizon=2.0))
    monitor.add(2, cloud, static=True, pose=cm.Pose())
    start = cm.Pose((0.1, 0, 4), Rotation.random(rng=rng).as_quat())
    for object_id, other in enumerate(OTHERS, start=10):
        monitor.add(object_id, other, group=2, mask=1)
    ids = list(range(10, 10 + len(OTHERS)))
    twist = [0, 0, -3, 0.5, 1, 0]
    found = monitor.step(SECOND, ids, [row_of(start)] * len(ids), [twist] * len(ids)).predictions
    assert len(found) == len(ids)
    motion = cm.Motion(start, twist[:3], twist[3:])
    for row in found:
        other = OTHERS[row["id_b"] - 10]
        truth = cm.time_of_impact(other, motion, cloud, cm.Motion(cm.Pose()))
        assert row["status"] == PredictionStatus.HIT
        assert row["lower"] <= truth.upper and row["upper"] >= truth.lower


def clouds_and_robot(pipeline: Pipeline, step: int) -> list[bytes]:
    """The answers of a step of a pipeline, with a new scan as a message before it."""
    rng = np.random.default_rng(step)
    cloud, pose = cm.Points(rng.normal(size=(300, 3)), 0.05), cm.Pose((3, 0, 0.1 * step))
    scan = ObjectDescription(7, cloud, static=True, pose=pose)
    data = encode_descriptions(step, "world", [scan])
    assert len(pipeline.on_shapes(data)) == 1
    states = np.zeros(1, STATE)
    states["id"], states["quaternion"] = 1, (0, 0, 0, 1)
    states["position"], states["linear"] = (0.1 * step, 0, 0), (1, 0, 0)
    result = pipeline.monitor.step((1 + step) * SECOND // 10, states)
    return [result.contact_rows.tobytes(), result.predictions.tobytes()]


def test_a_restored_monitor_gives_the_same_bytes():
    profile = Profile(contact_margin=0.5)
    pipeline = Pipeline(profile, "world", timed=False)
    first = ObjectDescription(1, [(cm.Mesh(TORUS.vertices, TORUS.faces), cm.Pose()), (cm.Box((1, 1, 1)), cm.Pose())])
    pipeline.on_shapes(encode_descriptions(0, "world", [first]))
    for step in range(4):
        clouds_and_robot(pipeline, step)
    snapshot = Snapshot.decode(pipeline.snapshot().encode())
    again = Pipeline.restored(snapshot, "world")
    for step in range(4, 9):
        assert clouds_and_robot(pipeline, step) == clouds_and_robot(again, step)
    assert pipeline.monitor.digest == again.monitor.digest


def test_clouds_on_the_wire_and_what_is_refused():
    cloud = cm.Points(np.random.default_rng(0).normal(size=(50, 3)), 0.25)
    data = encode_descriptions(0, "world", [ObjectDescription(3, cloud, static=True, pose=cm.Pose())])
    (made,) = decode_descriptions(data).objects
    ((shape, _),) = made.shapes
    assert np.array_equal(shape.points, cloud.points) and shape.radius == 0.25
    at = data.index(cloud.points.tobytes())
    bad = data[:at] + np.float64(np.nan).tobytes() + data[at + 8 :]
    ((_, text),) = decode_descriptions(bad).refused
    assert "Points: expected finite coordinates" in text
    monitor = Monitor()
    with pytest.raises(cm.UnsupportedError, match="Points"):
        monitor.add(1, cloud, static=True, pose=cm.Pose(), model="obb")


def test_a_cloud_beyond_the_time_of_a_message_gets_its_tree_later():
    points = np.random.default_rng(0).normal(size=(MOST_CLOUD_POINTS, 3))
    preparation = Preparation(limit=0.0)
    pipeline = Pipeline(Profile(), "world", preparation=preparation)
    whole = [ObjectDescription(k, cm.Points(points, 0.1), static=True, pose=cm.Pose()) for k in (1, 2)]
    taken = pipeline.take_shapes(encode_descriptions(0, "world", whole)).changes
    assert [change.model for change in taken] == [Model.AUTO, Model.AABB]
    preparation.close()
