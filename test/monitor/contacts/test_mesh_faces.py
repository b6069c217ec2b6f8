"""Features of convex meshes, which are tested as hulls, in the numbers of the user's faces."""

from __future__ import annotations

import numpy as np
import pytest
from named_features import agrees, off_feature, random_pose

import collision_monitor as cm
from collision_monitor import Pose
from collision_monitor.errors import InputError
from collision_monitor.geometry.bounding_volumes import convex_hull
from collision_monitor.monitor.contacts.mesh_faces import MeshFaces
from collision_monitor.monitor.state.snapshot import Snapshot
from collision_monitor.query.contact.features import feature_of, shape_tie


def ball_mesh(seed=2, n=40, radius=0.5):
    """A convex mesh with points on a sphere, with vertices that no face has, in an order that is not the hull's."""
    rng = np.random.default_rng(seed)
    points = rng.normal(size=(n, 3))
    hull = convex_hull(radius * points / np.linalg.norm(points, axis=1, keepdims=True))
    order = rng.permutation(len(hull.vertices))
    vertices = np.vstack([[0.1, 0.0, 0.0], hull.vertices[order]])
    faces = np.argsort(order)[hull.faces] + 1
    return cm.Mesh(vertices, [np.roll(face, k % 3) for k, face in enumerate(faces[rng.permutation(len(faces))])])


def box_mesh(size):
    """A box as a mesh: each side is two triangles."""
    hull = convex_hull(cm.Box(size).corners)
    return cm.Mesh(hull.vertices, hull.faces[::-1])


BALL, BRICK = ball_mesh(), box_mesh((0.7, 0.9, 0.5))
U = cm.Mesh([(0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1), (0.2, 0.2, 0.2)], [[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 4],
            [2, 3, 4], [3, 1, 4]])  # fmt: skip
OTHERS = {
    "box": cm.Box((0.6, 0.5, 0.7)), "cylinder": cm.Cylinder(0.4, 0.7), "sphere": cm.Sphere(0.4), "ball": BALL,
    "brick": BRICK, "concave": U, "ellipsoid": cm.Ellipsoid((0.6, 0.4, 0.3)),
}  # fmt: skip


def monitor_of(*objects, profile=None):
    """A monitor with these (shapes, pose) as static and the first one as a moving object."""
    monitor = cm.Monitor(profile or cm.Profile(contact_margin=10.0))
    for k, (shape, pose) in enumerate(objects):
        monitor.add(k, shape, static=k > 0, pose=pose if k else None, model="exact")
    return monitor


def step(monitor, X, seconds=0):
    state = [[*X.position, *X.quaternion]]
    return monitor.step(seconds * 10**9, [0], state, np.zeros((1, 6))).contacts


def check(row, a, X, b, Y):
    for side, shape, pose, sign in (("a", a, X, 1.0), ("b", b, Y, -1.0)):
        if not isinstance(shape, cm.Mesh):
            continue
        kind, index = int(row[f"feature_type_{side}"]), int(row[f"feature_index_{side}"])
        point = row[f"point_{side}"]
        assert off_feature(shape, (point - pose.position) @ pose.rotation, kind, index) < 2e-6
        off = min(float(row["error_bound"]), 1e-5)
        assert agrees(shape, kind, index, feature_of(shape, pose, point, sign * row["normal"], shape_tie(a, b), off))


@pytest.mark.parametrize("other", OTHERS)
@pytest.mark.parametrize("mesh", [BALL, BRICK], ids=["ball", "brick"])
def test_they_are_those_of_contact_features(mesh, other):
    rng = np.random.default_rng(1)
    for _ in range(12):
        X, Y = random_pose(rng, 0.3), random_pose(rng, 0.5)
        (row,) = step(monitor_of((mesh, None), (OTHERS[other], Y)), X)
        assert row["model_a"] == 1
        check(row, mesh, X, OTHERS[other], Y)


def test_a_vertex_on_a_sphere_and_a_face_on_a_floor():
    (row,) = step(monitor_of((cm.Sphere(0.2), None), (BALL, Pose())), Pose(1.2 * BALL.vertices[7]))
    assert row["feature_type_b"] == 1 and BALL.faces.ravel()[row["feature_index_b"]] == 7
    (row,) = step(monitor_of((BRICK, None), (cm.HalfSpace((0, 0, 1)), Pose())), Pose((0, 0, 0.25)))
    assert row["feature_type_a"] == 3
    assert (BRICK.vertices[BRICK.faces[row["feature_index_a"]], 2] == -0.25).all()


def test_parts_with_a_pose_and_a_padding():
    at = Pose((0.2, -0.3, 0.4), (0.5, 0.5, 0.5, 0.5))
    X, Y = Pose((0.1, 0.2, 0.3), (0, 0.6, 0, 0.8)), Pose((1.4, 0.3, 0.2))
    monitor = cm.Monitor(cm.Profile(contact_margin=10.0))
    monitor.add(0, [(BALL, at), (cm.Sphere(0.1), Pose((-3, 0, 0)))], padding=0.05, model="exact")
    monitor.add(1, BRICK, static=True, pose=Y, model="convex_hull")
    (row,) = step(monitor, X)
    placed = X @ at
    kind, index = int(row["feature_type_a"]), int(row["feature_index_a"])
    x = (row["point_a"] - 0.05 * row["normal"] - placed.position) @ placed.rotation
    assert off_feature(BALL, x, kind, index) < 1e-6
    if row["feature_type_b"]:
        x = (row["point_b"] - Y.position) @ Y.rotation
        assert off_feature(BRICK, x, int(row["feature_type_b"]), int(row["feature_index_b"])) < 1e-6


@pytest.mark.parametrize("tolerance", [0.0, 1e-3])
def test_a_restored_monitor_names_the_same(tolerance):
    Y = Pose((0.7, 0.1, 0.2))
    profile = cm.Profile(contact_margin=10.0, distance_tolerance=tolerance)
    monitor = monitor_of((BALL, None), (BRICK, Y), (BALL, Pose((0, 1, 0))), profile=profile)
    step(monitor, Pose())
    snapshot = Snapshot.decode(monitor.snapshot().encode())
    assert len(snapshot.arrays["faces.count"]) == 2  # equal meshes are saved once
    restored = cm.Monitor.restored(monitor.profile, snapshot)
    X = Pose((0.01, 0.02, 0.0))
    mine, other = step(monitor, X, 1), step(restored, X, 1)
    assert mine.tobytes() == other.tobytes() and len(mine) == 2
    for row, mesh, pose in zip(mine, (BRICK, BALL), (Y, Pose((0, 1, 0))), strict=True):
        check(row, BALL, X, mesh, pose)


def test_a_snapshot_with_other_faces_is_refused():
    snapshot = monitor_of((BALL, None), (BRICK, Pose())).snapshot()
    for name, value in (
        ("faces.slot", np.array([0, 0], np.int32)), ("faces.slot", np.array([0, 900], np.int32)),
        ("faces.of", np.array([0, 2], np.int32)), ("faces.count", np.array([1, 0], np.int32)),
        ("faces.corners", np.full_like(snapshot.arrays["faces.corners"], np.nan)),
    ):  # fmt: skip
        with pytest.raises(InputError):
            cm.Monitor.restored(cm.Profile(), Snapshot({**snapshot.arrays, name: value}, snapshot.facts))


def test_faces_are_forgotten_with_the_object():
    monitor = monitor_of((BALL, None), (BALL, Pose()), (BRICK, Pose()))
    faces = monitor._roster.mesh_faces
    assert len(faces) == 3 and faces != MeshFaces()
    monitor.add(0, cm.Sphere(0.5), replace=True)
    monitor.remove(1)
    assert len(faces) == 1 and len(faces.table(64).corners) == len(BRICK.faces)
    monitor.remove(2)
    assert faces == MeshFaces() and not faces.arrays()
