"""The monitor with exact meshes: the contacts of `contact`, certified impacts, snapshots, budgets."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh
from scipy.spatial.transform import Rotation

import collision_monitor as cm
from collision_monitor.monitor.monitor import Monitor
from collision_monitor.monitor.state.snapshot import Snapshot
from collision_monitor.records import ContactStatus, Model, PredictionStatus
from collision_monitor.settings.profile import Profile

SECOND = 1_000_000_000
TORUS = trimesh.creation.torus(1.0, 0.35, major_sections=14, minor_sections=8)
RING = cm.Mesh(TORUS.vertices, TORUS.faces)
RNG = np.random.default_rng(4)
OTHERS = [
    RING,
    cm.Sphere(0.3),
    cm.Box((0.5, 0.7, 0.4)),
    cm.Capsule(0.15, 0.8),
    cm.Cylinder(0.25, 0.7),
    cm.Cone(0.3, 0.8),
    cm.ConvexHull(RNG.normal(size=(12, 3)) * 0.35),
]
FLOOR = cm.HalfSpace((0.1, 0.2, 1.0), -0.2)


def states(count: int, seed: int, far: float = 0.7) -> np.ndarray:
    rng = np.random.default_rng(seed)
    return np.concatenate([far * rng.normal(size=(count, 3)), Rotation.random(count, rng=rng).as_quat()], axis=1)


@pytest.mark.parametrize("other", [*OTHERS, FLOOR], ids=lambda shape: type(shape).__name__)
def test_its_contacts_are_those_of_contact(other):
    monitor = Monitor(Profile(contact_margin=10.0))
    monitor.add(1, RING)
    static = isinstance(other, cm.HalfSpace)
    monitor.add(2, other, **({"static": True, "pose": cm.Pose()} if static else {}))
    overlapping = 0
    for step in range(12):
        poses = states(2, step)
        at = [cm.Pose(row[:3], row[3:]) for row in poses]
        if static:
            at[1] = cm.Pose()
        (row,) = monitor.step((1 + step) * SECOND, [1] if static else [1, 2], poses[:1] if static else poses).contacts
        truth = cm.contact(RING, at[0], other, at[1])
        assert row["model_a"] == row["model_b"] == Model.EXACT
        if truth.signed_distance > 0.0 or static:
            assert row["signed_distance"] == pytest.approx(truth.signed_distance, abs=1e-9)
            assert row["error_bound"] < 1e-6
            assert row["normal"] == pytest.approx(truth.normal, abs=1e-4)
            assert row["point_a"] + row["signed_distance"] * row["normal"] == pytest.approx(row["point_b"], abs=1e-9)
        else:
            overlapping += 1
            assert row["signed_distance"] <= 0.0
            low = -row["signed_distance"] - row["error_bound"]
            high = -row["signed_distance"] + row["error_bound"]
            assert low <= -truth.signed_distance + truth.error_bound and -truth.signed_distance <= high + 1e-9
        assert row["status"] == ContactStatus.TOUCHING
    assert static or overlapping


@pytest.mark.parametrize("other", [*OTHERS, FLOOR], ids=lambda shape: type(shape).__name__)
def test_its_impacts_are_certified_and_those_of_time_of_impact(other):
    static = isinstance(other, cm.HalfSpace)
    hits = 0
    for seed in range(8):
        rng = np.random.default_rng(100 + seed)
        poses = states(2, seed, 0.2)
        poses[0, :3] += (0, 0, 3.5)
        twists = 0.8 * rng.normal(size=(2, 6))
        twists[0, 2] = -3.0
        monitor = Monitor(Profile(horizon=2.0))
        monitor.add(1, RING)
        monitor.add(2, other, **({"static": True, "pose": cm.Pose()} if static else {}))
        ids = [1] if static else [1, 2]
        found = monitor.step(SECOND, ids, poses[: len(ids)], twists[: len(ids)]).predictions
        if static:
            poses[1], twists[1] = (0, 0, 0, 0, 0, 0, 1), 0.0
        motions = [cm.Motion(cm.Pose(p[:3], p[3:]), t[:3], t[3:]) for p, t in zip(poses, twists, strict=True)]
        truth = cm.time_of_impact(RING, motions[0], other, motions[1])
        # before the impact the shapes are apart, at its upper end they overlap, by contacts of their own
        if truth.status == "clear":
            assert not len(found)
            continue
        hits += 1
        (row,) = found
        assert row["status"] == PredictionStatus.HIT and truth.status == "hit"
        assert row["lower"] <= truth.lower + 1e-9 and truth.lower <= row["upper"]
        assert row["upper"] - row["lower"] < 0.05
        for t in np.linspace(0.0, truth.lower, 6)[:-1]:
            assert not cm.overlap(RING, motions[0].at(t), other, motions[1].at(t))
        assert cm.contact(RING, motions[0].at(truth.upper), other, motions[1].at(truth.upper)).signed_distance <= 1e-12
    assert hits >= 2


def slab(height: float) -> cm.Mesh:
    """An L of constant height: 1 x 0.3 in x and y, and 0.3 x 0.7 behind its end at -x."""
    outline = [(-0.5, -0.5), (0.5, -0.5), (0.5, -0.2), (-0.2, -0.2), (-0.2, 0.5), (-0.5, 0.5)]
    flat = [(0, 1, 2), (0, 2, 3), (0, 3, 4), (0, 4, 5)]
    faces = [(a, c, b) for a, b, c in flat] + [(a + 6, b + 6, c + 6) for a, b, c in flat]
    faces += [face for k in range(6) for j in [(k + 1) % 6] for face in ((k, j, j + 6), (k, j + 6, k + 6))]
    return cm.Mesh([(*p, z) for z in (0.0, height) for p in outline], faces)


@pytest.mark.parametrize("profile", ["exact", "balanced", Profile()], ids=["exact", "balanced", "default"])
@pytest.mark.parametrize("turn", [Rotation.identity(), Rotation.from_rotvec((0.3, -1.0, 0.7))], ids=["level", "turned"])
def test_slabs_on_one_floor_that_meet_end_to_end_are_a_hit(profile, turn):
    """Their tops, bottoms and sides lie in one plane each, so that no triangles cross while they go into each other."""
    slabs, end = slab(0.2), np.array((1.5, 0.0, 0.0))
    for other in (cm.Box((1.0, 1.0, 0.2)), slab(0.2)):
        level = (0.0, 0.0, 0.1) if isinstance(other, cm.Box) else (0.0, 0.0, 0.0)
        for sign, when in ((-1.0, 0.5), (1.0, None)):
            monitor = cm.Monitor(profile)
            monitor.add(1, slabs)
            monitor.add(2, [(other, cm.Pose(level))])
            quaternion = turn.as_quat()
            poses = np.array([(*np.zeros(3), *quaternion), (*turn.apply(end), *quaternion)])
            twists = np.zeros((2, 6))
            twists[1, :3] = turn.apply((sign, 0, 0))
            found = monitor.step(0, [1, 2], poses, twists).predictions
            assert len(found) == (when is not None)
            for row in found:
                assert row["status"] == PredictionStatus.HIT
                assert row["lower"] <= when <= row["upper"] + 1e-9 and row["upper"] - row["lower"] < 1e-3
                assert np.abs(turn.inv().apply(row["normal"])) == pytest.approx([1, 0, 0], abs=1e-3)
                assert row["closing_speed"] == pytest.approx(1.0, abs=1e-3)


def scene(profile: Profile) -> Monitor:
    monitor = Monitor(profile)
    for k, shape in enumerate(OTHERS):
        monitor.add(k, shape)
    monitor.add(20, [(RING, cm.Pose((0.3, 0, 0))), (cm.Sphere(0.2), cm.Pose((0, 1, 0)))], padding=0.02)
    monitor.add(21, FLOOR, static=True, pose=cm.Pose((0, 0, -1)))
    return monitor


@pytest.mark.parametrize("profile", [Profile(), Profile(pairs_per_step=6, contact_points=4)], ids=["whole", "budget"])
def test_a_restored_monitor_goes_on_with_the_same_bytes(profile):
    monitor, ids = scene(profile), [*range(len(OTHERS)), 20]
    for step in range(3):
        monitor.step((1 + step) * 50_000_000, ids, states(len(ids), step, 1.5), states(len(ids), 50 + step)[:, :6])
    data = monitor.snapshot().encode()
    other = Monitor.restored(profile, Snapshot.decode(data))
    for name, array in other.snapshot().arrays.items():
        assert array.tobytes() == monitor.snapshot().arrays[name].tobytes(), name
    for step in range(3, 6):
        poses, twists = states(len(ids), step, 1.5), states(len(ids), 50 + step)[:, :6]
        a, b = (m.step((1 + step) * 50_000_000, ids, poses, twists) for m in (monitor, other))
        assert a.contacts.tobytes() == b.contacts.tobytes() and a.predictions.tobytes() == b.predictions.tobytes()
        assert len(a.contacts)
    assert monitor.digest == other.digest
    # removed and described anew, the trees use the same room again
    blocks = len(monitor._roster.multibody.table.blocks)
    for _ in range(5):
        monitor.remove(20)
        monitor.add(20, RING)
    assert len(monitor._roster.multibody.table.blocks) == blocks


def test_a_snapshot_with_damaged_meshes_is_refused():
    monitor = scene(Profile())
    snapshot = monitor.snapshot()
    damages = {"meshes.of": 7, "meshes.triangles": 5, "meshes.parts": 0, "meshes.corners": np.nan}
    for name, value in damages.items():
        arrays = {key: array.copy() for key, array in snapshot.arrays.items()}
        arrays[name].reshape(-1)[0] = value
        with pytest.raises(cm.InputError, match="snapshot"):
            Monitor.restored(Profile(), Snapshot(arrays, snapshot.facts))


def test_the_plan_names_meshes():
    plan = scene(Profile()).plan
    assert plan.shapes["mesh"] == 2 and plan.tests["sphere", "mesh"] == "meshes"
    assert "trees of triangles" in str(plan)


def test_every_overlap_at_rest_is_a_contact_without_a_margin() -> None:
    """A search for surfaces nearer than 0 finds none that touch; all of these contacts were missed once."""
    x, y = np.meshgrid(np.arange(6.0), np.arange(6.0))
    k = np.arange(30)[np.arange(30) % 6 != 5]
    corners = np.column_stack([x.ravel(), y.ravel(), np.sin(x * y).ravel()])
    sheet = cm.Mesh(corners, np.column_stack([k, k + 6, k + 1]))
    ring = trimesh.creation.torus(1.0, 0.3, major_sections=16, minor_sections=8)
    rng = np.random.default_rng(4)
    poses = np.zeros((2, 7))
    poses[:, 6] = 1.0
    for mesh in (sheet, cm.Mesh(ring.vertices, ring.faces)):
        low, high = mesh.vertices.min(axis=0) - 0.3, mesh.vertices.max(axis=0) + 0.3
        for solid in (cm.Sphere(0.5), cm.Box((0.5, 0.6, 0.7)), cm.Capsule(0.2, 0.5), cm.Cylinder(0.3, 0.6)):
            for position in rng.uniform(low, high, (8, 3)):
                monitor = cm.Monitor("exact")
                monitor.add(1, mesh)
                monitor.add(2, solid)
                poses[1, :3] = position
                truth = cm.contact(mesh, cm.Pose(), solid, cm.Pose(position))
                found = len(monitor.step(0, [1, 2], poses).contacts)
                assert found == truth.overlaps or abs(truth.signed_distance) < 1e-9, (mesh, solid, position)


def test_a_plate_without_thickness_meets_a_mesh_where_it_is():
    plate = cm.Box((2.0, 1.0, 0.0))
    monitor = Monitor(Profile(contact_margin=10.0))
    monitor.add(1, RING)
    monitor.add(2, plate)
    for step in range(6):
        poses = states(2, 50 + step, 1.0)
        (row,) = monitor.step((1 + step) * SECOND, [1, 2], poses).contacts
        truth = cm.contact(RING, cm.Pose(poses[0, :3], poses[0, 3:]), plate, cm.Pose(poses[1, :3], poses[1, 3:]))
        assert (row["signed_distance"] > 0.0) == (truth.signed_distance > 0.0)
        if truth.signed_distance > 0.0:
            assert row["signed_distance"] == pytest.approx(truth.signed_distance, abs=1e-9)
