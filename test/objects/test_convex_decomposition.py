"""Tests that the convex parts of a concave mesh contain it and exceed it by at most the stated error."""

from __future__ import annotations

import sys

import numpy as np
import pytest
import trimesh
from scipy.spatial import ConvexHull as Qhull
from scipy.spatial import cKDTree

import collision_monitor as cm
from collision_monitor import Mesh, Pose, Sphere, contact
from collision_monitor.geometry.polyhedra import locate_in_polyhedron
from collision_monitor.objects import convex_decomposition as module
from collision_monitor.objects.models import containing_model
from collision_monitor.records import Model

TORUS = trimesh.creation.torus(0.5, 0.2, major_sections=8, minor_sections=5)
RING = Mesh(np.add(TORUS.vertices, (3, 0, 0)), TORUS.faces)
CORNERS = np.array([(0, 0), (3, 0), (3, 3), (2, 3), (2, 1), (1, 1), (1, 3), (0, 3)], float)
U_PROFILE = trimesh.creation.extrude_triangulation(
    CORNERS, np.array([(0, 4, 5), (0, 1, 4), (1, 2, 4), (2, 3, 4), (0, 5, 7), (5, 6, 7)]), 1.0
)
U_SHAPE = Mesh(U_PROFILE.vertices, U_PROFILE.faces)


@pytest.mark.parametrize("mesh", [RING, U_SHAPE], ids=["ring", "U"])
def test_parts_contain_the_mesh_and_say_how_far_they_stand_out(mesh):
    pytest.importorskip("coacd")
    found = module.convex_decomposition(mesh)
    assert module.convex_decomposition(mesh) is found
    body = trimesh.Trimesh(mesh.vertices, mesh.faces)
    planes = [Qhull(part.points).equations for part in found.parts]
    rng = np.random.default_rng(1)
    low, high = body.bounds
    points = rng.uniform(low - 0.1, high + 0.1, (20000, 3))
    inside = locate_in_polyhedron(points, mesh.vertices, mesh.faces) >= 0
    on_it = trimesh.sample.sample_surface(body, 40000, seed=1)[0]
    contained = np.zeros(len(points) + len(on_it), bool)
    for plane in planes:
        contained |= (np.vstack([points, on_it]) @ plane[:, :3].T + plane[:, 3]).max(axis=1) <= 0.0
    assert contained[len(points) :].all()
    assert contained[: len(points)][inside].all()
    # distance of the added volume from dense samples of the surface
    extra = np.vstack([points[contained[: len(points)] & ~inside], *(part.points for part in found.parts)])
    extra = extra[locate_in_polyhedron(extra, mesh.vertices, mesh.faces) < 0]
    apart = cKDTree(on_it).query(extra)[0].max()
    spacing = 0.05
    assert apart - spacing <= found.surface_error <= apart + spacing
    assert found.surface_error < 0.03 * np.ptp(mesh.vertices, axis=0).max()
    volume = sum(Qhull(part.points).volume for part in found.parts)
    assert volume / body.volume - 1 == pytest.approx(found.volume_error, abs=1e-9)
    assert len(found.parts) < 20


def test_as_a_model_it_is_better_than_the_hull():
    pytest.importorskip("coacd")
    parts, hull = (containing_model([(U_SHAPE, Pose())], model) for model in ("convex_decomposition", "convex_hull"))
    assert parts.model is Model.CONVEX_DECOMPOSITION and parts.excess < 0.05 * hull.excess
    ball, between = Sphere(0.4), Pose((1.5, 2.0, 0.5))
    exact = contact(U_SHAPE, Pose(), ball, between)
    c = contact(U_SHAPE, Pose(), ball, between, model="convex_decomposition")
    assert c.signed_distance > 0.0  # the ball is between the arms, inside the hull
    assert abs(c.signed_distance - exact.signed_distance) <= c.error_bound + exact.error_bound
    monitor = cm.Monitor()
    monitor.add(1, U_SHAPE, model=Model.CONVEX_DECOMPOSITION)
    monitor.add(2, ball)
    poses = [(0, 0, 0, 0, 0, 0, 1), (1.5, 2.0, 0.5, 0, 0, 0, 1)]
    assert not len(monitor.step(10**9, [1, 2], poses).contacts)
    poses[1] = (1.5, 1.3, 0.5, 0, 0, 0, 1)
    (row,) = monitor.step(2 * 10**9, [1, 2], poses).contacts
    assert row["model_a"] == Model.CONVEX_DECOMPOSITION and row["signed_distance"] < 0.0


def test_what_is_convex_is_itself_and_what_is_open_is_refused():
    assert containing_model([(Sphere(1), Pose())], "convex_decomposition").excess == 0.0
    pytest.importorskip("coacd")
    with pytest.raises(cm.ShapeError, match="closed"):
        contact(Mesh(U_SHAPE.vertices, U_SHAPE.faces[1:]), Pose(), Sphere(1), Pose(), model="convex_decomposition")
    with pytest.raises(cm.InputError, match=r"concavity: expected a number from 0\.01 to 1, got 2"):
        module.convex_decomposition(U_SHAPE, 2)


def test_without_the_library_it_says_what_to_install(monkeypatch):
    monkeypatch.setitem(sys.modules, "coacd", None)
    with pytest.raises(cm.UnsupportedError, match=r"pip install '.\[decomposition\]'"):
        contact(Mesh(U_SHAPE.vertices, U_SHAPE.faces), Pose(), Sphere(1), Pose(), model="convex_decomposition")


FLAT = {
    "flat": [[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0]],
    "thin": [[0, 0, 0], [1, 0, 0], [0, 1, 0], [0.3, 0.3, 1e-17]],
    "needle": [[0, 0, 0], [1, 0, 0], [0.5, 0, 0], [0.25, 1e-300, 0]],
    "point": [[1, 2, 3]] * 4,
}
CLOSED = np.array([[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]])


@pytest.mark.parametrize("corners", FLAT.values(), ids=FLAT)
def test_a_mesh_without_an_inside_is_refused(corners):
    pytest.importorskip("coacd")
    with pytest.raises(cm.ShapeError, match=r"expected points that span a solid|expected a closed mesh"):
        module.convex_decomposition(Mesh(np.array(corners, float), CLOSED))


def test_a_bent_sheet_with_two_sides_is_refused():
    pytest.importorskip("coacd")
    corners = np.array([(0, 0, 0), (1, 0, 0), (0, 1, 0), (1, 1, 1)], float)
    sheet = np.array([(0, 1, 2), (1, 3, 2)])
    with pytest.raises(cm.ShapeError, match="expected a closed mesh"):
        module.convex_decomposition(Mesh(corners, np.concatenate([sheet, sheet[:, ::-1]])))


def test_without_a_solid_part_the_search_for_a_cover_ends(monkeypatch):
    coacd = pytest.importorskip("coacd")
    flat = np.array(FLAT["flat"], float)
    monkeypatch.setattr(coacd, "run_coacd", lambda *_, **__: [(flat, CLOSED)])
    with pytest.raises(cm.UnsupportedError, match="no solid part"):
        module.convex_decomposition(Mesh(U_SHAPE.vertices.copy(), U_SHAPE.faces))
