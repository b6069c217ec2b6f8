"""Closed solids beside a sheet in one mesh, such as houses on a ground plane, and faces that are listed twice."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh

import collision_monitor as cm
from collision_monitor.objects.closed_parts import separated
from collision_monitor.shapes.feature_types import FACE

BOX = trimesh.creation.box((2.0, 2.0, 2.0))
RING = trimesh.creation.torus(1.0, 0.4, major_sections=24, minor_sections=12)
GROUND = np.array([(-5.0, -5, -1.5), (5, -5, -1.5), (5, 5, -1.5), (-5, 5, -1.5)])


def beside_ground(solid: trimesh.Trimesh) -> cm.Mesh:
    faces = np.array([(0, 1, 2), (0, 2, 3)]) + len(solid.vertices)
    return cm.Mesh(np.concatenate([solid.vertices, GROUND]), np.concatenate([solid.faces, faces]))


def monitored(mesh: cm.Mesh, other: cm.Shape, place: tuple[float, float, float]) -> cm.StepResult:
    monitor = cm.Monitor()
    monitor.add(1, mesh, static=True, pose=cm.Pose())
    monitor.add(2, other)
    return monitor.step(0, [2], [(*place, 0, 0, 0, 1)])


def test_closed_parts_and_sheets_are_meshes_of_their_own() -> None:
    mesh = beside_ground(BOX)
    closed, sheet = separated(mesh)
    assert closed.surface.closed and len(closed.surface.faces) == len(BOX.faces)
    assert len(closed.faces) == len(mesh.faces)  # the numbers stay
    assert sheet.surface.sheet and len(sheet.faces) == 2 and sheet.surface.certain
    assert "beside closed parts" in repr(mesh)
    assert separated(closed) == (closed,) and separated(sheet) == (sheet,)


@pytest.mark.parametrize("solid", [BOX, RING], ids=["convex", "concave"])
@pytest.mark.parametrize(
    "other", [cm.Sphere(0.1), cm.Box((0.1, 0.1, 0.1)), cm.Cylinder(0.05, 0.1), cm.Points([(0.0, 0, 0)], 0.01)]
)
def test_what_is_inside_of_a_closed_part_is_in_contact(solid: trimesh.Trimesh, other: cm.Shape) -> None:
    """A ground plane in the same file made a house hollow: a ball in it was clear."""
    mesh, place = beside_ground(solid), (0.9, 0.0, 0.0)
    alone, found = (cm.contact(each, cm.Pose(), other, cm.Pose(place)) for each in (cm.Mesh(*_arrays(solid)), mesh))
    assert alone.overlaps and found.overlaps
    assert abs(found.signed_distance - alone.signed_distance) <= found.error_bound + alone.error_bound
    still, motion = cm.Motion(cm.Pose()), cm.Motion(cm.Pose(place), (0.1, 0, 0))
    assert cm.time_of_impact(mesh, still, other, motion, horizon=2.0).lower == 0.0
    (contact,) = monitored(mesh, other, place).contacts
    assert contact["signed_distance"] < 0.0


@pytest.mark.parametrize("solid", [BOX, RING], ids=["convex", "concave"])
@pytest.mark.parametrize("first", [True, False], ids=["ground first", "ground last"])
def test_a_contact_names_the_face_of_the_whole_mesh(solid: trimesh.Trimesh, first: bool) -> None:
    order = slice(None, None, -1) if first else slice(None)
    whole = beside_ground(solid)
    mesh = cm.Mesh(whole.vertices, whole.faces[order])
    centre, normal = solid.triangles_center[7], solid.face_normals[7]
    found = monitored(mesh, cm.Sphere(0.1), tuple(centre + 0.09 * normal)).contacts[0]
    assert found["feature_type_a"] == FACE
    corners = mesh.vertices[mesh.faces[found["feature_index_a"]]]
    assert np.abs((corners - centre) @ normal).max() < 1e-9


def test_above_the_ground_nothing_touches_and_below_the_sheet_nothing_is_inside() -> None:
    for height in (-1.3, -1.7, -4.0):
        place = (3.0, 3.0, height)
        assert cm.contact(beside_ground(BOX), cm.Pose(), cm.Sphere(0.1), cm.Pose(place)).signed_distance > 0.05
        assert len(monitored(beside_ground(BOX), cm.Sphere(0.1), place).contacts) == 0


def test_points_within_a_closed_part_are_found() -> None:
    cloud = cm.Points([(0.0, 0.0, 0.0), (0.0, 0.0, -1.5), (3.0, 3.0, 0.0)], 0.01)
    assert cm.points_within(cloud, cm.Pose(), beside_ground(BOX), cm.Pose()).tolist() == [True, True, False]


@pytest.mark.parametrize("repeat", [lambda f: f[:1], lambda f: f, lambda f: f[:, ::-1]], ids=["one", "all", "back"])
def test_faces_that_are_listed_twice_count_once(repeat) -> None:
    """The monitor put the convex hull in the place of such a mesh."""
    vertices, faces = _arrays(RING)
    mesh = cm.Mesh(vertices, np.concatenate([faces, repeat(faces)]))
    inside, hole = (1.0, 0.0, 0.0), (0.0, 0.0, 0.0)
    assert len(monitored(mesh, cm.Sphere(0.1), hole).contacts) == 0
    (contact,) = monitored(mesh, cm.Sphere(0.1), inside).contacts
    exact = cm.contact(cm.Mesh(vertices, faces), cm.Pose(), cm.Sphere(0.1), cm.Pose(inside))
    assert contact["signed_distance"] == pytest.approx(exact.signed_distance, abs=1e-9)
    assert contact["model_a"] == cm.Model.EXACT


def _arrays(mesh: trimesh.Trimesh) -> tuple[np.ndarray, np.ndarray]:
    return np.array(mesh.vertices), np.array(mesh.faces)
