"""Tests of the cascade for two polyhedra: each stage alone, and results against rational numbers and FCL."""

import fcl
import numpy as np
import pytest
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st
from point_sets import rotation
from rational import in_polyhedron, segment_meets_triangle
from solids import SKEWS, bar, cube, hollow, ring, u_shape

from collision_monitor.errors import ShapeError
from collision_monitor.geometry.lecture.cascade import CascadeStage, polyhedra_intersect
from collision_monitor.geometry.polyhedra import mesh_edges


def moved(solid, shift, turn=None):
    vertices, faces = solid
    return (vertices if turn is None else vertices @ turn.T) + shift, faces


def meet(a, b):
    """Whether two solids meet, in rational numbers and without a cascade."""
    for (points, faces), other in ((a, b), (b, a)):
        if any(in_polyhedron(p, *other) >= 0 for p in points):
            return True
        triangles = other[0][other[1]]
        for i, j in mesh_edges(faces):
            ends = points[[i, j]]
            near = (triangles.min(axis=1) <= ends.max(axis=0)) & (ends.min(axis=0) <= triangles.max(axis=1))
            if any(segment_meets_triangle(*ends, *t) for t in triangles[near.all(axis=1)]):
                return True
    return False


def test_each_stage():
    apart = polyhedra_intersect(*cube(), *moved(cube(), [3, 0, 0]))
    assert not apart.collides and apart.stage is CascadeStage.BOUNDING_VOLUMES
    corner = polyhedra_intersect(*cube(), *moved(cube(), [0.5, 0.5, 0.5]))
    assert corner.collides and corner.stage is CascadeStage.VERTICES
    assert cube()[0][corner.vertices_a].tolist() == [[1, 1, 1]]
    assert moved(cube(), [0.5, 0.5, 0.5])[0][corner.vertices_b].tolist() == [[0.5, 0.5, 0.5]]
    crossed = polyhedra_intersect(
        *moved(cube(), [-2, 0, 0], np.diag([5, 1, 1])), *moved(cube(), [0.25, -2, 0.25], np.diag([0.5, 5, 0.5]))
    )
    assert crossed.collides and crossed.stage is CascadeStage.EDGES_AND_FACES
    assert len(crossed.edges_a) and len(crossed.edges_b)
    beside = polyhedra_intersect(*u_shape(), *moved(cube(), [1.25, 0, 1.25], np.eye(3) / 2))
    assert not beside.collides and beside.stage is CascadeStage.EDGES_AND_FACES  # the cube is between the arms


def test_one_within_the_other_and_within_its_cavity():
    within = polyhedra_intersect(*moved(cube(), [1, 1, 0.25], np.eye(3) / 2), *bar(3, 3, 1))
    assert within.collides and within.stage is CascadeStage.VERTICES and len(within.vertices_a) == 8
    cavity = polyhedra_intersect(*moved(cube(), [1.25, 1.25, 1.25], np.eye(3) / 2), *hollow())
    assert not cavity.collides
    through = polyhedra_intersect(*moved(bar(1, 1, 5), [1.25, 1.25, -2], np.diag([0.5, 0.5, 1])), *ring())
    assert not through.collides  # the bar passes through the hole


@settings(max_examples=12)
@given(st.tuples(*[st.integers(-3, 6)] * 3), st.sampled_from([u_shape, ring]))
def test_touching_at_corners_edges_and_faces(shift, solid):
    upright = solid(), moved(cube(), np.array(shift) / 2, np.diag([1, 0.5, 2]))
    expected = meet(*upright)
    for skew in SKEWS.values():
        a, b = (moved(s, 0, skew) for s in upright)
        assert polyhedra_intersect(*a, *b).collides == polyhedra_intersect(*b, *a).collides == expected


def test_random_solids_against_fcl():
    rng = np.random.default_rng(0)
    torus = trimesh.creation.torus(1.0, 0.4, major_sections=12, minor_sections=8)
    solids = [u_shape(), ring(), cube(), (np.array(torus.vertices), np.array(torus.faces))]
    seen = set()
    for trial in range(60):
        a, b = (moved(solids[k], rng.normal(size=3), rotation(trial + k)) for k in rng.integers(len(solids), size=2))
        objects = []
        for vertices, faces in (a, b):
            model = fcl.BVHModel()
            model.beginModel(len(vertices), len(faces))
            model.addSubModel(vertices, faces)
            model.endModel()
            objects.append(fcl.CollisionObject(model))
        surfaces_cross = fcl.collide(*objects) > 0
        found = polyhedra_intersect(*a, *b)
        if surfaces_cross:
            assert found.collides
        if not found.collides or found.stage is CascadeStage.EDGES_AND_FACES:
            assert found.collides == surfaces_cross  # FCL's meshes are surfaces without an inside
        seen.add((found.collides, found.stage))
    assert len(seen) >= 3


def test_open_and_impossible_meshes_are_refused():
    vertices, faces = cube()
    with pytest.raises(ShapeError, match="mesh B: expected a closed surface"):
        polyhedra_intersect(vertices, faces, vertices, faces[1:])
    with pytest.raises(ShapeError, match="mesh A faces"):
        polyhedra_intersect(vertices, faces + 5, vertices, faces)
