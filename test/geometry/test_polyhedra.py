"""Tests of points in polyhedra and of edges through faces against rational numbers."""

import numpy as np
import pytest
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st
from rational import EXPONENTS, POINTS_3D, in_polyhedron, segment_meets_triangle
from solids import CONCAVE, CONVEX, SKEWS, cube

from collision_monitor.errors import InputError, ShapeError
from collision_monitor.geometry.bounding_volumes import convex_hull
from collision_monitor.geometry.point_in_polygon import Location
from collision_monitor.geometry.polyhedra import (
    edge_face,
    is_closed,
    locate_in_convex_polyhedron,
    locate_in_polyhedron,
    mesh_edges,
)

HALVES = st.integers(-1, 7).map(lambda n: n / 2)


@pytest.mark.parametrize("name", [*CONCAVE, *CONVEX])
def test_points_on_corners_edges_and_faces_and_rays_through_them(name):
    vertices, faces = {**CONCAVE, **CONVEX}[name]()
    rng = np.random.default_rng(len(name))
    points = rng.integers(-2, 8, (30, 3)) / 2
    points = np.vstack([points, vertices[:4], vertices[faces[:3]].mean(axis=1) * 3, (vertices[0] + vertices[1]) / 2])
    expected = [in_polyhedron(p, vertices, faces) for p in points]
    for turn in [skew * scale for skew in SKEWS.values() for scale in (1.0, 2.0**-30, 2.0**30)]:
        assert locate_in_polyhedron(points @ turn.T, vertices @ turn.T, faces).tolist() == expected
        if name in CONVEX:
            assert locate_in_convex_polyhedron(points @ turn.T, vertices @ turn.T, faces).tolist() == expected


@settings(max_examples=20)
@given(st.integers(0, 2**32 - 1))
def test_convex_and_parity_tests_agree_on_hulls(seed):
    rng = np.random.default_rng(seed)
    hull = convex_hull(rng.normal(size=(12, 3)))
    a, b = rng.integers(len(hull.vertices), size=(2, 20))
    points = np.vstack([rng.normal(size=(40, 3)), hull.vertices, hull.vertices[a] / 2 + hull.vertices[b] / 2])
    by_planes = locate_in_convex_polyhedron(points, hull.vertices, hull.faces)
    assert by_planes.tolist() == locate_in_polyhedron(points, hull.vertices, hull.faces).tolist()


def test_a_curved_concave_mesh():
    torus = trimesh.creation.torus(2.0, 0.5, major_sections=24, minor_sections=12)
    points = np.random.default_rng(0).uniform(-3, 3, (2000, 3)) * [1, 1, 0.25]
    to_ring = np.hypot(np.hypot(points[:, 0], points[:, 1]) - 2, points[:, 2])
    found = locate_in_polyhedron(points, torus.vertices, torus.faces)
    assert (found[to_ring > 0.52] == Location.OUTSIDE).all()
    assert (found[to_ring < 0.4] == Location.INSIDE).all()
    assert (found == Location.INSIDE).sum() > 100


def test_leading_dimensions():
    vertices, faces = cube()
    points = np.array([[[0.5, 0.5, 0.5], [2, 2, 2]], [[0, 0.5, 0.5], [1, 1, 1]]])
    expected = [[Location.INSIDE, Location.OUTSIDE], [Location.BOUNDARY, Location.BOUNDARY]]
    assert locate_in_polyhedron(points, vertices, faces).tolist() == expected
    assert locate_in_convex_polyhedron(points, vertices, faces).tolist() == expected
    assert locate_in_polyhedron(points[0, 0], vertices, faces) == Location.INSIDE


def test_flat_triangles_and_unused_vertices_change_nothing():
    vertices, faces = cube()
    # split one edge: add a flat triangle along it, and divide its neighbour in two
    i, j, k = faces[0]
    vertices = np.vstack([vertices, (vertices[i] + vertices[j]) / 2, [9, 9, 9]])
    m = len(vertices) - 2
    faces = np.vstack([faces[1:], [[i, m, k], [m, j, k], [i, j, m]]])
    points = np.random.default_rng(0).integers(-1, 6, (100, 3)) / 4
    plain = locate_in_polyhedron(points, *cube())
    assert (locate_in_polyhedron(points, vertices, faces) == plain).all()
    assert (locate_in_convex_polyhedron(points, vertices, faces) == plain).all()


@given(st.tuples(*[POINTS_3D] * 5), EXPONENTS)
def test_edges_through_faces(points, exponent):
    p, q, a, b, c = np.array(points) * 2.0**exponent
    found = edge_face(p, q, a, b, c)
    if not np.cross(b - a, c - a).any():
        assert not found.meets
        return
    assert found.meets == segment_meets_triangle(p, q, a, b, c)
    for same in (edge_face(q, p, a, b, c), edge_face(p, q, c, b, a), edge_face(p, q, b, c, a)):
        assert same.meets == found.meets
    if found.meets and not np.isnan(found.t):
        assert 0 <= found.t <= 1
        n = np.cross(b - a, c - a)
        assert abs((found.point - a) @ n) <= 1e-14 * 64 * 8.0**exponent
        assert np.abs(p + found.t * (q - p) - found.point).max() <= 1e-14 * 2.0**exponent


@settings(max_examples=60)
@given(st.tuples(*[st.integers(-5, 5)] * 4), POINTS_3D, POINTS_3D)
def test_edges_in_the_plane_of_the_face(numbers, u, v):
    u, v = np.array(u, float), np.array(v, float)
    if not np.cross(u, v).any():
        return
    p, q = (numbers[0] * u + numbers[1] * v) / 2, (numbers[2] * u + numbers[3] * v) / 2
    found = edge_face(p, q, [0, 0, 0], 2 * u, 2 * v)
    assert found.meets == segment_meets_triangle(p, q, [0, 0, 0], 2 * u, 2 * v)


def test_edges_of_the_slides():
    triangle = [[0, 0, 0], [4, 0, 0], [0, 4, 0]]
    through = edge_face([1, 1, 1], [1, 1, -3], *triangle)
    assert through.meets and through.t == 0.25 and through.point.tolist() == [1, 1, 0]
    assert not edge_face([3, 3, 1], [3, 3, -1], *triangle).meets  # through the plane beside the face
    assert not edge_face([1, 1, 1], [1, 1, 2], *triangle).meets  # both ends on one side
    assert edge_face([1, 1, 1], [1, 1, 0], *triangle).meets  # one end on the face
    table = edge_face(np.zeros((5, 1, 3)), np.ones((5, 1, 3)), *np.random.default_rng(0).normal(size=(3, 7, 3)))
    assert table.meets.shape == (5, 7) and table.point.shape == (5, 7, 3)


def test_edges_and_closedness():
    vertices, faces = cube()
    assert len(mesh_edges(faces)) == 18  # 12 edges and a diagonal for each side: V - E + F = 2
    assert len(vertices) - 18 + len(faces) == 2
    assert is_closed(faces) and not is_closed(faces[1:])


def test_meshes_that_cannot_be_are_refused():
    vertices, faces = cube()
    with pytest.raises(ShapeError, match="closed surface"):
        locate_in_polyhedron([0, 0, 0], vertices, faces[1:])
    with pytest.raises(ShapeError, match="indices from 0 to 7"):
        locate_in_polyhedron([0, 0, 0], vertices, faces + 1)
    with pytest.raises(ShapeError, match="shape"):
        locate_in_polyhedron([0, 0, 0], vertices, np.zeros((0, 3), int))
    with pytest.raises(ShapeError, match="integers"):
        locate_in_convex_polyhedron([0, 0, 0], vertices, faces + 0.5)
    with pytest.raises(ShapeError, match="finite"):
        locate_in_convex_polyhedron([0, 0, 0], vertices * np.nan, faces)
    with pytest.raises(InputError, match="finite"):
        locate_in_polyhedron([0, 0, np.nan], vertices, faces)
    with pytest.raises(InputError, match="broadcast"):
        edge_face(np.zeros((2, 3)), np.zeros((3, 3)), [0, 0, 0], [1, 0, 0], [0, 1, 0])
