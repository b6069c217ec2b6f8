"""A body that appears inside a solid mesh, without crossing its surface, is a contact, never clear."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh

import collision_monitor as cm
from collision_monitor.records import ContactStatus

_TORUS = trimesh.creation.torus(1.0, 0.3, major_sections=12, minor_sections=6)
RING = cm.Mesh(_TORUS.vertices * [3, 3, 24], _TORUS.faces)
"""A ring about z, with a wall that is 1.5 m thick at 3 m from the axis."""

_CUBE = trimesh.creation.box((0.2, 0.2, 0.2))
_STAR = trimesh.creation.icosphere(1, 0.2)
_STAR.vertices[::3] *= 0.5
SMALL = {
    "sphere": cm.Sphere(0.2),
    "box": cm.Box((0.3, 0.3, 0.3)),
    "capsule": cm.Capsule(0.1, 0.3),
    "hull": cm.ConvexHull(_CUBE.vertices),
    "cylinder": cm.Cylinder(0.2, 0.5),
    "cone": cm.Cone(0.2, 0.5),
    "ellipsoid": cm.Ellipsoid((0.1, 0.3, 0.2)),
    "mesh": cm.Mesh(_STAR.vertices, _STAR.faces),
    "cloud": cm.Points(np.array([[0.0, 0, 0], [0.05, 0, 0]]), 0.1),
    "compound": [(cm.Sphere(0.1), cm.Pose((0, 0, 0.2))), (cm.Cylinder(0.1, 0.2), cm.Pose())],
}


def _step(shape: cm.Shape, x: float, swap: bool, speed: float = 0.0) -> cm.StepResult:
    monitor = cm.Monitor()
    ids = (2, 1) if swap else (1, 2)
    monitor.add(ids[0], RING)
    monitor.add(ids[1], shape)
    poses = [[0, 0, 0, 0, 0, 0, 1], [x, 0, 0, 0, 0, 0, 1]]
    return monitor.step(0, ids, poses, [[0] * 6, [speed, 0, 0, 0, 0, 0]])


@pytest.mark.parametrize("swap", [False, True])
@pytest.mark.parametrize("name", SMALL)
def test_a_body_inside_of_a_solid_is_a_contact(name: str, swap: bool) -> None:
    for speed in (0.0, 0.3):
        contacts = _step(SMALL[name], 3.0, swap, speed).contacts
        assert len(contacts) == 1
        assert contacts["status"][0] == ContactStatus.TOUCHING
        assert contacts["signed_distance"][0] + contacts["error_bound"][0] < 0.0 or name == "compound"
        if name != "compound":
            expected = cm.contact(RING, cm.Pose(), SMALL[name], cm.Pose((3.0, 0, 0)))
            assert contacts["signed_distance"][0] == pytest.approx(expected.signed_distance, abs=1e-5)


@pytest.mark.parametrize("name", SMALL)
def test_a_body_in_the_hole_of_a_ring_is_apart(name: str) -> None:
    assert len(_step(SMALL[name], 0.0, False).contacts) == 0


@pytest.mark.parametrize("name", SMALL)
def test_a_body_that_jumps_into_a_wall_and_out(name: str) -> None:
    monitor = cm.Monitor()
    monitor.add(1, RING, static=True, pose=cm.Pose())
    monitor.add(2, SMALL[name])
    found = []
    for step, x in enumerate((0.0, 3.0, 3.0, 0.0)):
        result = monitor.step(step * 100_000_000, [2], [[x, 0, 0, 0, 0, 0, 1]])
        found.append((len(result.contacts), len(result.ended)))
    assert found == [(0, 0), (1, 0), (1, 0), (0, 1)]
