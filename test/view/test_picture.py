"""Tests of the picture: levels, poses of impact, tubes, forms, far scenes."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from collision_monitor import records
from collision_monitor.codec import Removal, encode_descriptions, encode_states
from collision_monitor.motion.stated_motion import Motion
from collision_monitor.objects.description import ObjectDescription
from collision_monitor.pipeline.pipeline import Pipeline
from collision_monitor.records import ContactStatus, Phase, PredictionStatus, StateFlag
from collision_monitor.shapes.pose import Pose
from collision_monitor.shapes.registry import (
    Box,
    Capsule,
    Circle,
    Cone,
    ConvexHull,
    Cylinder,
    Ellipsoid,
    HalfSpace,
    Mesh,
    Points,
    Polygon,
    Shape,
    Sphere,
)
from collision_monitor.view.bodies import MOST_FORMS, DescribedBodies, described_pieces
from collision_monitor.view.instanced_forms import pieces_of
from collision_monitor.view.levels import COLORS, Level, object_levels
from collision_monitor.view.paths import SAMPLES, SIGMAS, tubes
from collision_monitor.view.picture import Role, draw
from collision_monitor.view.topic_content import TopicContent
from collision_monitor.world.scene import state_array

CORNERS = [(x, y, z) for x in (0.0, 1.0) for y in (0.0, 1.0) for z in (0.0, 1.0)]
SOLIDS: list[tuple[Shape, float]] = [
    (Sphere(0.5), 4 / 3 * np.pi * 0.5**3),
    (Box((1, 2, 3)), 6.0),
    (Cylinder(0.5, 2.0), np.pi * 0.25 * 2.0),
    (Cone(0.5, 3.0), np.pi * 0.25),
    (Ellipsoid((1, 2, 0.5)), 4 / 3 * np.pi),
    (ConvexHull(CORNERS), 1.0),
    (Capsule(0.5, 2.0), np.pi * 0.25 * 2.0 + 2 * 4 / 3 * np.pi * 0.5**3),  # both balls, whose halves are inside
]


def scene_of(*objects: ObjectDescription) -> TopicContent:
    scene = TopicContent()
    scene.take("ObjectDescriptionArray", encode_descriptions(1, "world", list(objects), snapshot=True))
    return scene


def answered(
    scene: TopicContent, objects: list[ObjectDescription], rows: np.ndarray, stamp: int = 10**9
) -> TopicContent:
    """Take states and the answers of a real pipeline."""
    pipeline = Pipeline("exact")
    pipeline.on_shapes(encode_descriptions(1, "world", objects, snapshot=True))
    data = encode_states(stamp, "world", 1, rows)
    outputs = pipeline.on_states(data)
    assert outputs is not None
    for kind, message in (
        ("ObjectStateArray", data),
        ("ContactArray", outputs.contacts),
        ("PredictedCollisionArray", outputs.predictions),
    ):
        scene.take(kind, message)
    return scene


@pytest.mark.parametrize(("shape", "volume"), SOLIDS, ids=lambda each: type(each).__name__)
def test_the_pieces_of_a_solid_have_its_volume_and_point_outwards(shape: Shape, volume: float) -> None:
    found = 0.0
    for form, pose, scale in pieces_of(shape, Pose((5.0, -3.0, 2.0))):
        vertices = (form.vertices * scale) @ pose.rotation.T + pose.position
        a, b, c = vertices[form.faces].swapaxes(0, 1) - pose.position
        if form.name == "tube":  # open; its ends are within the balls
            found += np.pi * scale[0] ** 2 * scale[2]
            assert (np.einsum("ni,ni->n", np.cross(b - a, c - a)[:, :2], (a + b + c)[:, :2]) > 0).all()
        else:
            found += np.einsum("ni,ni->n", a, np.cross(b, c)).sum() / 6.0
    assert 0.9 * volume < found < 1.001 * volume  # facets are within a round solid


@pytest.mark.parametrize(
    "shape",
    [HalfSpace((0.6, 0.0, 0.8), 2.0), Circle(0.4), Polygon([(0, 0), (2, 0), (2, 1), (1, 0.2), (0, 1)])],
    ids=lambda each: type(each).__name__,
)
def test_flat_shapes_lie_where_they_are(shape: Shape) -> None:
    ((form, pose, scale),) = pieces_of(shape, Pose())
    vertices = (form.vertices * scale) @ pose.rotation.T + pose.position
    if isinstance(shape, HalfSpace):
        np.testing.assert_allclose(vertices @ shape.normal, shape.offset, atol=1e-6)
        a, b, c = vertices[form.faces[0]]
        assert np.cross(b - a, c - a) @ shape.normal > 0.0
    else:
        assert not vertices[:, 2].any()
        a, b, c = vertices[form.faces].swapaxes(0, 1)
        area = 0.5 * np.abs(np.cross(b - a, c - a)[:, 2]).sum()
        assert area == pytest.approx(np.pi * 0.16 if isinstance(shape, Circle) else 1.2, rel=0.03)


def test_equal_meshes_share_a_form_and_too_many_become_boxes() -> None:
    faces = [(0, 1, 2), (0, 3, 1), (0, 2, 3), (1, 3, 2)]
    corners = np.array([(0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1)], float)
    twice = DescribedBodies([ObjectDescription(k, Mesh(corners, faces)) for k in range(3)])
    assert len(twice.pieces) == 1
    many = DescribedBodies([ObjectDescription(k, Mesh(corners * (1 + k), faces)) for k in range(MOST_FORMS + 5)])
    assert many.boxed == 5 and len(many.pieces) == MOST_FORMS + 1
    last = many.pieces["box"]
    np.testing.assert_allclose(last.scale[-1], MOST_FORMS + 5, rtol=1e-6)
    np.testing.assert_allclose(last.position[-1], (MOST_FORMS + 5) / 2, rtol=1e-6)


def test_levels_of_objects_are_the_highest_of_their_pairs() -> None:
    ids = np.arange(1, 8, dtype=np.uint32)
    contacts = np.zeros(3, records.CONTACT)
    contacts["id_a"], contacts["id_b"] = (1, 2, 5), (2, 3, 6)
    contacts["status"] = (ContactStatus.TOUCHING, ContactStatus.UNRESOLVED, ContactStatus.TOUCHING)
    contacts["phase"] = (Phase.BEGIN, Phase.PERSIST, Phase.END)
    predictions = np.zeros(4, records.PREDICTION)
    predictions["id_a"], predictions["id_b"] = (1, 4, 5, 6), (4, 5, 99, 7)
    status = PredictionStatus
    predictions["status"] = (status.HIT, status.POSSIBLE, status.UNRESOLVED, status.POSSIBLE)
    static = ids == 7
    expected = [
        Level.TOUCHING, Level.TOUCHING, Level.UNRESOLVED, Level.PREDICTED, Level.UNRESOLVED, Level.POSSIBLE,
        Level.POSSIBLE,
    ]  # fmt: skip
    assert object_levels(ids, static, True, contacts, predictions).tolist() == expected
    unknown = [Level.UNRESOLVED] * 6 + [Level.STATIC]
    assert object_levels(ids, static, False, contacts, predictions).tolist() == unknown
    alerts = {(1, 2): Level.WARNING, (2, 3): Level.CAUTION}
    by_alerts = object_levels(ids, static, True, contacts, predictions, alerts)[:4].tolist()
    assert by_alerts == [Level.WARNING, Level.WARNING, Level.CAUTION, Level.CLEAR]
    assert object_levels(ids[:0], static[:0], True, contacts, predictions, alerts).size == 0


@given(
    st.floats(-2, 2), st.floats(0.2, 1.5), st.floats(-1, 1), st.floats(-1, 1), st.sampled_from([0.0, 3e5]),
)  # fmt: skip
def test_poses_of_impact_touch(y: float, speed: float, spin: float, acceleration: float, far: float) -> None:
    """The ghosts stand where `Motion.at` says, and touch there: oracle is the distance of the two spheres."""
    objects = [
        ObjectDescription(1, Sphere(0.5)),
        ObjectDescription(2, Sphere(0.5), static=True, pose=Pose((far, 0, 0))),
    ]
    rows = state_array(np.array([1], np.uint32))
    motion = Motion(Pose((far - 2.0, 0.1 * y, 0)), (speed, 0, 0), (0, 0, spin), (0.2 * acceleration, 0, 0))
    rows["position"], rows["linear"], rows["angular"] = motion.pose.position, motion.linear, motion.angular
    rows["acceleration"], rows["flags"] = motion.acceleration, StateFlag.ACCELERATION_VALID
    moment = answered(scene_of(*objects), objects, rows).moment()
    picture = draw(moment)
    hits = moment.predictions[moment.predictions["status"] == PredictionStatus.HIT]
    assert len(picture.rows) == len(moment.predictions)
    assert ((Role.IMPACT, "sphere") in picture.batches) == bool(len(hits))
    if len(hits):
        ghost = picture.batches[Role.IMPACT, "sphere"]
        assert ghost.ids.tolist() == [1]
        at = motion.at(float(hits["lower"][0])).position
        np.testing.assert_allclose(ghost.position[0] + picture.origin, at, atol=1e-5)
        assert np.linalg.norm(at - (far, 0, 0)) == pytest.approx(1.0, abs=2e-3)
        assert (picture.origin != 0).any() == (far > 0)


def test_tubes_contain_the_stated_uncertainty() -> None:
    objects = [ObjectDescription(1, Sphere(0.5), max_linear_acceleration=0.5), ObjectDescription(2, Sphere(0.5))]
    rows = state_array(np.array([1, 2], np.uint32))
    rows["position"] = [(0, 0, 0), (3, 0, 0)]
    rows["linear"][0] = (1, 0, 0)
    rows["position_stddev"], rows["velocity_stddev"] = (0.01, 0.0), (0.1, 0.0)
    moment = answered(scene_of(*objects), objects, rows).moment()
    assert len(moment.predictions) == 1
    picture = draw(moment)
    until = float(moment.predictions["lower"][0]) if moment.predictions["status"][0] == 0 else moment.horizon
    vertices, faces = picture.tubes
    assert len(picture.paths) == 2 * (SAMPLES - 1)
    radius = SIGMAS * np.hypot(0.01, 0.1 * until) + 0.25 * until**2
    assert np.abs(vertices[:, 1]).max() == pytest.approx(radius, rel=1e-3)
    assert vertices[:, 0].max() == pytest.approx(until + radius, rel=0.01)
    edges = np.sort(np.stack([faces, np.roll(faces, -1, axis=1)], axis=-1).reshape(-1, 2), axis=1)
    _, counts = np.unique(edges, axis=0, return_counts=True)
    assert (counts <= 2).all()
    assert tubes(np.zeros((0, 3, 3)), np.zeros((0, 3)))[1].shape == (0, 3)


def test_a_covariance_widens_the_tube_by_its_worst_axis() -> None:
    scene = scene_of(ObjectDescription(1, Sphere(0.5)))
    rows = state_array(np.array([1], np.uint32))
    covariance = np.array([0.04, 0, 0, 0.01, 0, 0.01, 0.09, 0, 0, 0.01, 0, 0.01])
    scene.take("ObjectStateArray", encode_states(5, "world", 0, rows, covariance))
    state = scene.moment().state
    assert state["position_stddev"][0] == pytest.approx(0.2) and state["velocity_stddev"][0] == pytest.approx(0.3)


def test_unknown_twists_are_estimated_from_two_poses() -> None:
    scene = scene_of(ObjectDescription(1, Box((1, 1, 1))))
    rows = state_array(np.array([1], np.uint32))
    rows["flags"] = StateFlag.TWIST_UNKNOWN
    rows["linear"] = np.nan
    scene.take("ObjectStateArray", encode_states(10**9, "world", 0, rows))
    assert not scene.moment().state["linear"].any()
    rows["position"], rows["quaternion"] = (1, 0, 0), Pose.from_euler(0, 0, 0.5).quaternion
    scene.take("ObjectStateArray", encode_states(2 * 10**9, "world", 0, rows))
    state = scene.moment().state[0]
    np.testing.assert_allclose(state["linear"], (1, 0, 0))
    np.testing.assert_allclose(state["angular"], (0, 0, 0.5), atol=1e-9)


def test_what_the_monitor_refuses_moves_nothing() -> None:
    scene = scene_of(ObjectDescription(1, Sphere(0.5)), ObjectDescription(2, Sphere(0.5), static=True, pose=Pose()))
    scene.frame_id = "world"
    good = state_array(np.array([1, 2, 77], np.uint32))
    good["position"] = (1, 2, 3)
    scene.take("ObjectStateArray", encode_states(5, "world", 0, good))
    before = scene.moment()
    assert before.ids.tolist() == [1, 2] and before.state["position"].tolist() == [[1, 2, 3], [0, 0, 0]]
    for change in ({"position": np.nan}, {"quaternion": (0, 0, 0, 2)}, {"linear": np.inf}):
        bad = good[:1].copy()
        bad["position"] = (9, 9, 9)
        for name, value in change.items():
            bad[name] = value
        scene.take("ObjectStateArray", encode_states(6, "world", 0, bad))
    late = good[:1].copy()
    late["position"] = (8, 8, 8)
    scene.take("ObjectStateArray", encode_states(4, "world", 0, late))
    scene.take("ObjectStateArray", encode_states(7, "elsewhere", 0, late))
    assert scene.moment().state.tobytes() == before.state.tobytes()
    scene.take("ObjectDescriptionArray", encode_descriptions(8, "world", [Removal(1)]))
    assert scene.moment().ids.tolist() == [2]
    scene.take("ObjectDescriptionArray", encode_descriptions(9, "world", [ObjectDescription(1, Sphere(0.5))]))
    assert scene.moment().ids.tolist() == [2] and scene.moment().unseen == 1


def test_a_copied_scene_is_independent() -> None:
    scene = scene_of(ObjectDescription(1, Sphere(0.5)), ObjectDescription(2, Sphere(0.5)))
    rows = state_array(np.array([1, 2], np.uint32))
    scene.take("ObjectStateArray", encode_states(5, "world", 0, rows))
    copied = scene.copy()
    copied.take("ObjectDescriptionArray", encode_descriptions(6, "world", [Removal(2)]))
    rows["position"] = 1.0
    copied.take("ObjectStateArray", encode_states(7, "world", 0, rows))
    assert scene.moment().ids.tolist() == [1, 2] and not scene.moment().state["position"].any()
    assert copied.moment().ids.tolist() == [1] and copied.moment().state["position"].all()


def test_compounds_are_placed_as_a_whole() -> None:
    parts = [(Box((1, 1, 1)), Pose((2, 0, 0))), (Sphere(0.5), Pose((0, 3, 0), Pose.from_euler(0, 0, 1).quaternion))]
    body = ObjectDescription(4, parts, static=True, pose=Pose.from_euler(0, 0, np.pi / 2, (10, 0, 0)))
    picture = draw(scene_of(body).moment())
    np.testing.assert_allclose(picture.batches[Role.STATIC, "box"].position, [(10, 2, 0)], atol=1e-6)
    np.testing.assert_allclose(picture.batches[Role.STATIC, "sphere"].position, [(7, 0, 0)], atol=1e-6)
    assert (picture.batches[Role.STATIC, "box"].color == COLORS[Level.STATIC]).all()
    assert len(described_pieces(body)) == 2


def test_an_empty_scene_has_a_picture() -> None:
    picture = draw(TopicContent().moment())
    assert not picture.batches and not picture.rows and not picture.is_known and picture.extent > 0.0


def test_clouds_are_points_at_their_poses_in_the_colour_of_their_object() -> None:
    cloud, turned = np.array([(1.0, 0, 0), (0, 2, 0), (0, 0, 3)]), Pose((5, 0, 0), (0, 0, 1, 0))  # by 180 degrees
    scan = ObjectDescription(1, Points(cloud, 0.05), static=True, pose=turned)
    ball = ObjectDescription(2, Sphere(0.5))
    rows = state_array(np.array([2], np.uint32))
    rows["position"] = 5, -2, 0
    picture = draw(answered(scene_of(scan, ball), [scan, ball], rows).moment())
    assert np.allclose(picture.clouds, [(4, 0, 0), (5, -2, 0), (5, 0, 3)], atol=1e-6)
    assert (picture.cloud_colors == COLORS[Level.TOUCHING]).all()
    assert picture.cloud_diameter == pytest.approx(0.1)
    assert {name for _, name in picture.batches} == {"sphere"}
