"""Contacts of meshes within the `distance_tolerance`: with solids, and with a padding that touches earlier."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh
from scipy.spatial.transform import Rotation

import collision_monitor as cm
from collision_monitor.settings.profile import Profile
from collision_monitor.world.arm import link

SOLIDS: dict[str, cm.Shape] = {
    "cylinder": cm.Cylinder(0.2, 0.7),
    "cone": cm.Cone(0.3, 0.6),
    "ellipsoid": cm.Ellipsoid((0.1, 0.3, 0.5)),
    "half-space": cm.HalfSpace((0.0, 0.6, 0.8), 0.1),
}
MESH = link(0.8, 0.15)


@pytest.mark.parametrize("solid", list(SOLIDS))
@pytest.mark.parametrize("tolerance", [0.002, 0.05])
def test_a_contact_of_a_mesh_and_a_solid_is_within_its_bound(solid: str, tolerance: float) -> None:
    rng = np.random.default_rng(4)
    profile = Profile(uncertainty=False, distance_tolerance=tolerance, mesh_impact_tolerance=0.1)
    shapes = {1: MESH, 2: SOLIDS[solid], 3: MESH}  # the mesh has the smaller id, and the larger one
    seen = inexact = 0
    for _ in range(25):
        monitor = cm.Monitor(profile=profile)
        poses = {i: cm.Pose(rng.normal(size=3) * 0.25, Rotation.random(rng=rng).as_quat()) for i in shapes}
        for i, shape in shapes.items():
            is_static = isinstance(shape, cm.HalfSpace)
            monitor.add(i, shape, static=is_static, pose=poses[i] if is_static else None)
        ids = [i for i in shapes if not isinstance(shapes[i], cm.HalfSpace)]
        rows = np.array([np.concatenate([poses[i].position, poses[i].quaternion]) for i in ids])
        result = monitor.step(0, ids, rows, np.zeros((len(ids), 6)))
        found = {(int(c["id_a"]), int(c["id_b"])): c for c in result.contacts}
        for i, j in ((1, 2), (2, 3)):
            exact = cm.contact(shapes[i], poses[i], shapes[j], poses[j])
            if abs(exact.signed_distance) > 1e-6:
                assert ((i, j) in found) == (exact.signed_distance <= 0.0)
            if (i, j) not in found:
                continue
            seen += 1
            row = found[i, j]
            off = abs(row["signed_distance"] - exact.signed_distance)
            assert off <= min(row["error_bound"], tolerance + 1e-9) + 1e-9
            inexact += off > 1e-9
            normal = row["normal"]
            assert np.isclose(np.linalg.norm(normal), 1.0)
            np.testing.assert_allclose(np.cross(row["point_b"] - row["point_a"], normal), 0.0, atol=1e-6)
            shift = (row["error_bound"] - row["signed_distance"] + 1e-6) * normal  # a translation that parts them
            away = cm.Pose(poses[j].position + shift, poses[j].quaternion)
            assert cm.contact(shapes[i], poses[i], shapes[j], away).signed_distance >= 0.0
    assert seen > 8
    assert inexact > 0.5 * seen


def test_the_padding_of_meshes_touches_before_their_surfaces() -> None:
    for padding, touches in ((0.02, True), (0.005, False)):
        monitor = cm.Monitor(profile="fast")
        for i in (1, 2):
            monitor.add(i, cm.Mesh(*_cube()), padding=padding)
        poses = np.array([[0, 0, 0, 0, 0, 0, 1.0], [1.02, 0, 0, 0, 0, 0, 1.0]])
        for step in range(3):
            result = monitor.step(step * 20_000_000, [1, 2], poses, np.zeros((2, 6)))
            assert bool(len(result.contacts)) == touches


def test_a_solid_inside_a_mesh_is_a_contact() -> None:
    monitor = cm.Monitor(profile="fast")
    monitor.add(1, cm.Mesh(*_cube()))
    monitor.add(2, cm.Cylinder(0.1, 0.2))
    poses = np.array([[0, 0, 0, 0, 0, 0, 1.0], [0.1, 0, 0, 0, 0, 0, 1.0]])
    for step in range(3):
        result = monitor.step(step * 20_000_000, [1, 2], poses, np.zeros((2, 6)))
        assert len(result.contacts) == 1
        assert result.contacts["signed_distance"][0] < 0.0


def _cube() -> tuple[np.ndarray, np.ndarray]:
    cube = trimesh.creation.box((1, 1, 1))
    return cube.vertices, cube.faces
