"""Defects that the fuzzers found, each with its smallest input."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
import trimesh
from processor_time import within

from collision_monitor.codec import decode_status, encode_descriptions, encode_states
from collision_monitor.codec.descriptions import decode_descriptions
from collision_monitor.errors import InputError
from collision_monitor.geometry.oriented_boxes import obb_minimum_volume
from collision_monitor.monitor.monitor import Monitor
from collision_monitor.monitor.state.snapshot import Snapshot
from collision_monitor.objects.description import ObjectDescription
from collision_monitor.objects.preparation_cost import Budget
from collision_monitor.pipeline.pipeline import Pipeline
from collision_monitor.pipeline.settings_event import LIMIT, encode_settings
from collision_monitor.records import STATE, Model
from collision_monitor.settings.profile import Profile
from collision_monitor.shapes.convex_pieces import is_convex_mesh
from collision_monitor.shapes.pose import Pose
from collision_monitor.shapes.registry import Box, Circle, ConvexHull, Cylinder, HalfSpace, Mesh, Sphere

SIDES = [[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]]


@pytest.mark.parametrize("model", [m for m in Model if m is not Model.CONVEX_DECOMPOSITION])
def test_a_mesh_of_one_point_is_refused_or_monitored(model: Model) -> None:
    pipeline = Pipeline()
    mesh = Mesh(np.full((4, 3), -0.5), SIDES)
    changes = pipeline.on_shapes(encode_descriptions(0, "world", [ObjectDescription(1, mesh, model=model)]))
    refused = decode_status(pipeline.status()).refused_shape
    assert len(changes) + refused == 1
    assert pipeline.monitor.ids == [change.object_id for change in changes]


@pytest.mark.parametrize("model", [m for m in Model if m is not Model.CONVEX_DECOMPOSITION])
def test_a_needle_is_refused_or_monitored(model: Model) -> None:
    pipeline = Pipeline()
    needle = Mesh([[0, 0, 0], [1, 0, 0], [0, 1e-13, 0], [0, 0, 1e-13]], SIDES)
    changes = pipeline.on_shapes(encode_descriptions(0, "world", [ObjectDescription(1, needle, model=model)]))
    assert len(changes) + decode_status(pipeline.status()).refused_shape == 1


@pytest.mark.parametrize("size", [1e-12, 1e-9, 1e-3, 1.0, 1e9])
def test_the_smallest_box_does_not_depend_on_the_unit(size: float) -> None:
    points = np.random.default_rng(1).normal(size=(130, 3))
    points /= np.linalg.norm(points, axis=1, keepdims=True)
    box, unit = obb_minimum_volume(points * size), obb_minimum_volume(points)
    np.testing.assert_allclose(box.half_extents / size, unit.half_extents, rtol=1e-6)


BEYOND: dict[str, dict[str, Any]] = {
    "padding": {"shapes": Sphere(1.0), "padding": 1e308},
    "max_linear_acceleration": {"shapes": Sphere(1.0), "max_linear_acceleration": 1e300},
    "max_angular_acceleration": {"shapes": Sphere(1.0), "max_angular_acceleration": 1e19},
}


@pytest.mark.parametrize("what", BEYOND)
def test_numbers_of_a_description_have_the_limit_of_those_of_a_state(what: str) -> None:
    with pytest.raises(InputError, match=f"object 1.*{what}.*1e\\+18"):
        ObjectDescription(1, **BEYOND[what])


def test_a_description_beyond_the_limit_is_refused_alone() -> None:
    good = ObjectDescription(2, Sphere(1.0), padding=0.25)
    data = encode_descriptions(0, "world", [ObjectDescription(1, Sphere(1.0), padding=0.125), good])
    changed = data.replace(np.float64(0.125).tobytes(), np.float64(1e300).tobytes())
    assert changed != data
    message = decode_descriptions(changed)
    assert [each.object_id for each in message.objects] == [2]
    assert [object_id for object_id, _ in message.refused] == [1]


def test_a_snapshot_between_a_setting_and_the_next_step_holds_the_setting() -> None:
    hull = ConvexHull(np.random.default_rng(1).normal(size=(8, 3)))
    pipeline = Pipeline(timed=False)
    pipeline.on_shapes(encode_descriptions(0, "world", [ObjectDescription(k, hull) for k in range(40)]))
    rows = np.zeros(40, STATE)
    rows["id"], rows["quaternion"][:, 3] = np.arange(40), 1.0
    rows["position"][:, 0], rows["linear"][:, 1] = np.arange(40), np.arange(40) % 3
    pipeline.on_settings(encode_settings(0, "", {LIMIT: 1}))
    restored = Pipeline.restored(Snapshot.decode(pipeline.snapshot().encode()), "world")
    first, second = (each.on_states(encode_states(1, "world", 1, rows)) for each in (pipeline, restored))
    assert first is not None and second is not None
    assert first.result.status.deferred > 0, "the limit has an effect"
    assert first.digest == second.digest


def test_a_snapshot_of_a_monitor_with_a_limit_of_pairs_goes_on_with_the_sphere_trees() -> None:
    """Long bodies side by side: their bounding spheres meet, and only their sphere trees show that they do not."""
    pipeline = Pipeline(Profile(pairs_per_step=1), timed=False)
    planks = [ObjectDescription(k, Box((4.0, 0.1, 0.1))) for k in range(6)]
    pipeline.on_shapes(encode_descriptions(0, "world", planks))
    rows = np.zeros(6, STATE)
    rows["id"], rows["quaternion"][:, 3] = np.arange(6), 1.0
    rows["position"][:, 1] = 1.5 * np.arange(6)
    rows["angular"][:, 2] = 0.1 * np.arange(6)
    pipeline.on_states(encode_states(1, "world", 1, rows))
    restored = Pipeline.restored(Snapshot.decode(pipeline.snapshot().encode()), "world")
    for step in range(2, 5):
        rows["linear"][:, 1] = step % 2  # all are predicted anew
        first, second = (each.on_states(encode_states(step, "world", step, rows)) for each in (pipeline, restored))
        assert first is not None and second is not None
        assert first.result.status == second.result.status
        assert first.digest == second.digest


@pytest.mark.parametrize("restored", [False, True])
def test_a_snapshot_that_turns_a_plane_scene_into_one_in_space_is_taken_as_a_whole(restored: bool) -> None:
    pipeline = Pipeline()
    flat = [ObjectDescription(k, Circle(1.0)) for k in (3, 4)]
    solid = [ObjectDescription(k, Sphere(1.0)) for k in (1, 2, 3)]
    for objects in (flat, solid, flat):
        pipeline.on_shapes(encode_descriptions(0, "world", objects, snapshot=True))
        assert pipeline.monitor.ids == [each.object_id for each in objects]
        if restored:
            pipeline = Pipeline.restored(Snapshot.decode(pipeline.snapshot().encode()), "world")
    pipeline.on_shapes(encode_descriptions(0, "world", solid))
    assert pipeline.monitor.ids == [3, 4], "a message that is no snapshot removes nothing"
    assert decode_status(pipeline.status()).refused_shape == 3


def test_a_snapshot_needs_no_description_to_keep_an_object_whose_next_one_is_refused() -> None:
    """A restored pipeline has no descriptions; it removed the object, which the original pipeline kept."""
    pipeline = Pipeline()
    pipeline.on_shapes(encode_descriptions(0, "world", [ObjectDescription(1, Sphere(1.0))]))
    restored = Pipeline.restored(Snapshot.decode(pipeline.snapshot().encode()), "world")
    mixed = [(HalfSpace((0.0, 0.0, 1.0)), Pose()), (Sphere(1.0), Pose())]
    impossible = ObjectDescription(1, mixed, static=True, pose=Pose(), model=Model.OBB)
    for each in (pipeline, restored):
        each.on_shapes(encode_descriptions(0, "world", [impossible]))
        assert decode_status(each.status()).refused_shape == 1
        assert each.monitor.ids == [1]


def test_a_concave_mesh_beside_other_shapes_is_estimated_by_its_faces() -> None:
    x, y = np.meshgrid(np.arange(6.0), np.arange(6.0))
    k = np.arange(30)[np.arange(30) % 6 != 5]
    surface = Mesh(np.column_stack([x.ravel(), y.ravel(), np.sin(x * y).ravel()]), np.column_stack([k, k + 6, k + 1]))
    beside = [(surface, Pose()), (Cylinder(0.1, 1.0), Pose())]
    assert Budget().fits([(surface, Pose())], Model.CONVEX_HULL)
    assert not Budget().fits(beside, Model.CONVEX_HULL)


@pytest.mark.parametrize("model", [Model.OBB, Model.KDOP14, Model.KDOP26, Model.CONVEX_HULL, Model.AABB])
def test_a_concave_mesh_beside_a_convex_one_takes_longer_than_the_estimate_of_both(model: Model) -> None:
    """876 bytes took 0.11 s: the distance from each face was computed, because the convex mesh is no set of faces."""
    solid = trimesh.creation.box((1.0, 1.0, 1.0))
    cube, dented = Mesh(solid.vertices, solid.faces), Mesh(solid.vertices * ([[0.2]] + 7 * [[1.0]]), solid.faces)
    assert is_convex_mesh(cube) and not is_convex_mesh(dented)
    assert Budget().fits([(cube, Pose()), (cube, Pose())], model)
    assert not Budget().fits([(dented, Pose()), (cube, Pose())], model)


@pytest.mark.parametrize("flat", [Box((1.0, 1.0, 1e-13)), Box((1.0, 1e-200, 1e-200))], ids=["plate", "needle"])
def test_a_flat_box_does_not_refuse_the_objects_after_it(flat: Box) -> None:
    """The tree of a box was made of its convex hull, which a flat box has not; every later object was refused."""
    pipeline = Pipeline()
    x, y = np.meshgrid(np.arange(6.0), np.arange(6.0))
    k = np.arange(30)[np.arange(30) % 6 != 5]
    surface = Mesh(np.column_stack([x.ravel(), y.ravel(), np.sin(x * y).ravel()]), np.column_stack([k, k + 6, k + 1]))
    objects = [
        ObjectDescription(1, flat, static=True, pose=Pose((2.0, 2.0, np.sin(4.0)))),
        ObjectDescription(2, surface, model=Model.EXACT),
        ObjectDescription(3, Sphere(0.5)),
    ]
    for each in objects:
        pipeline.on_shapes(encode_descriptions(0, "world", [each]))
    assert pipeline.monitor.ids == [1, 2, 3]
    states = np.zeros(2, STATE)
    states["id"], states["quaternion"][:, 3] = (2, 3), 1.0
    states["position"][1] = 2.0, 2.0, np.sin(4.0) + 0.2
    outputs = pipeline.on_states(encode_states(0, "world", 0, states))
    assert outputs is not None
    found = {(int(row["id_a"]), int(row["id_b"])) for row in outputs.result.contacts}
    assert found >= {(1, 2), (2, 3)} | ({(1, 3)} if flat.size[1] == 1.0 else set())


@pytest.mark.parametrize("seed", [3, 27])
def test_samples_of_a_huge_disc_beside_a_mesh_take_bounded_time(seed: int) -> None:
    """Each sample of a disc of 100 km that turns beside a mesh took 20 ms, and a step 5 s."""
    rng = np.random.default_rng(seed)
    torus = trimesh.creation.torus(1.0, 0.4, major_sections=12, minor_sections=12)
    monitor = Monitor(warns=False)
    monitor.add(1, Mesh(torus.vertices, torus.faces))
    monitor.add(2, Cylinder(95_677.0, 0.74))
    states = np.zeros(2, STATE)
    states["id"], quaternion = (1, 2), rng.normal(size=(2, 4))
    states["quaternion"] = quaternion / np.linalg.norm(quaternion, axis=1)[:, None]
    states["position"], states["linear"] = rng.uniform(-10, 10, (2, 3)), rng.uniform(-2, 2, (2, 3))
    states["angular"] = rng.uniform(-1, 1, (2, 3))
    states["position_stddev"], states["orientation_stddev"] = 0.05, 0.01
    monitor.step(0, states)
    states["position"] += 0.02 * states["linear"]
    with within(1.5):
        monitor.step(20_000_000, states)
