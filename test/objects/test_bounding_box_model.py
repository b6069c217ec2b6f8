"""The box of an object for which there is no time contains the object and exceeds it by at most what it states."""

from __future__ import annotations

import time

import numpy as np
import pytest
import trimesh

from collision_monitor import Box, Capsule, Circle, HalfSpace, Mesh, Polygon, Pose, Sphere, UnsupportedError
from collision_monitor.objects.bounding_box_model import bounding_box_model
from collision_monitor.objects.models import containing_model
from collision_monitor.objects.preparation_cost import MESSAGE_MS, Budget
from collision_monitor.records import Model

TORUS = trimesh.creation.torus(0.5, 0.2, major_sections=12, minor_sections=8)
RING = Mesh(TORUS.vertices, TORUS.faces)
TURNED = Pose((3, -1, 0.5), (0.5, 0.5, 0.5, 0.5))


def mesh(subdivisions: int, dent: float = 0.0) -> Mesh:
    it = trimesh.creation.icosphere(subdivisions)
    return Mesh(it.vertices * (1.0 + dent * np.sin(5 * it.vertices[:, :1])), it.faces)


@pytest.mark.parametrize(
    "shapes",
    [
        [(RING, TURNED)],
        [(RING, TURNED), (Sphere(0.3), Pose((1, 2, 3)))],
        [(Capsule(0.1, 2.0), TURNED), (Box((1, 2, 3)), Pose())],
    ],
    ids=["mesh", "mesh and sphere", "round ones"],
)
def test_it_is_the_box_of_the_model_aabb_with_a_wider_bound(shapes):
    ours, exact = bounding_box_model(shapes), containing_model(shapes, Model.AABB)
    (box, pose), (expected, place) = ours.pieces[0], exact.pieces[0]
    assert ours.model is exact.model is Model.AABB
    assert box.size == pytest.approx(expected.size, rel=1e-9)
    assert pose.position == pytest.approx(place.position, abs=1e-9)
    diagonal = np.linalg.norm(box.size)
    assert diagonal / 2 <= ours.excess <= diagonal * (1 + 1e-9)
    assert exact.excess <= ours.excess + diagonal / 24  # that one is accurate to half a cell


def test_in_the_plane_it_is_a_rectangle():
    star = Polygon([(0, 0), (2, 0), (2, 1), (1, 0.2), (0, 1)])
    found = bounding_box_model([(star, Pose()), (Circle(0.5), Pose((3, 0, 0)))])
    ((piece, pose),) = found.pieces
    corners = piece.points + pose.position[:2]
    assert corners.min(axis=0) == pytest.approx([0, -0.5], abs=1e-9)
    assert corners.max(axis=0) == pytest.approx([3.5, 1], abs=1e-9)
    assert (corners.min(axis=0) <= [0, -0.5]).all() and (corners.max(axis=0) >= [3.5, 1]).all()


def test_a_half_space_has_none():
    with pytest.raises(UnsupportedError, match="describe its other shapes alone"):
        bounding_box_model([(RING, Pose()), (HalfSpace((0, 0, 1)), Pose())])


def test_ordinary_objects_fit_and_a_huge_or_costly_one_does_not():
    budget = Budget()
    for shape in (Sphere(1), Box((1, 2, 3)), mesh(1)):
        assert all(budget.fits([(shape, Pose())], Model.AUTO) for _ in range(100))
    assert budget.left == MESSAGE_MS  # small objects are never put off
    assert budget.fits([(RING, Pose())], Model.AUTO) and 0 < budget.left < MESSAGE_MS
    for shape, model in ((mesh(5), Model.AUTO), (mesh(4, 0.3), Model.AUTO), (RING, Model.CONVEX_DECOMPOSITION)):
        left = budget.left
        began = time.perf_counter()
        assert not budget.fits([(shape, Pose())], model)
        assert time.perf_counter() - began < 0.1 and budget.left <= left
