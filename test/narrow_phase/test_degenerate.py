"""Degenerate shapes and poses: nearly parallel, without thickness, folded, doubled, mirrored."""

from __future__ import annotations

from itertools import combinations_with_replacement, product

import numpy as np
import pytest
from minkowski import rotation
from pairs import EYE, contact, points_of, projected_gap, size

import collision_monitor as cm
from collision_monitor.shapes.registry import Box, Capsule, Cone, ConvexHull, Cylinder, Mesh, Sphere

CUBE = points_of(Box((1, 1, 1)))
ANGLES = [0.0, *(10.0**-k for k in (3, 5, 7, 8, 9, 10, 12, 14, 16))]


def as_hull(box):
    return ConvexHull(points_of(box))


def about(axis, angle):
    x, y, z = axis / np.linalg.norm(axis)
    K = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.eye(3) + np.sin(angle) * K + (1 - np.cos(angle)) * K @ K


@pytest.mark.parametrize("angle", ANGLES)
def test_edges_that_are_nearly_parallel(angle):
    """Boxes and hulls at an angle from 1e-3 down to below the last bit answer like parallel ones, to the motion."""
    rng = np.random.default_rng(1)
    long, bar = Box((4, 0.3, 0.2)), Box((3, 0.2, 0.4))
    for _ in range(4):
        axis, p = rng.normal(size=3), rng.normal(size=3) * [0.5, 0.4, 0.4]
        R = about(axis, angle)
        for a, b in ((long, bar), (as_hull(long), bar), (as_hull(long), as_hull(bar))):
            turned, straight = contact(a, b, p, EYE, R), contact(a, b, p)
            assert abs(turned.distance - straight.distance) <= 2.2 * angle + 1e-9
            gap = projected_gap(a, b, p, EYE, R, turned.normal)
            assert abs(gap - turned.distance) <= turned.bound + 1e-14
        # along any direction the gap is at most the one that SAT found
        for direction in rng.normal(size=(5, 3)):
            n = direction / np.linalg.norm(direction)
            assert projected_gap(long, bar, p, EYE, R, n) <= contact(long, bar, p, EYE, R).distance + 1e-9


@pytest.mark.parametrize("thin", [1e-2, 1e-4, 1e-6, 1e-9])
@pytest.mark.parametrize("kind", ["needle", "pancake"])
def test_needles_and_pancakes(kind, thin):
    rng = np.random.default_rng(2)
    scale = [1, thin, thin] if kind == "needle" else [1, 1, thin]
    apart = 0
    for _ in range(15):
        a, b = (ConvexHull(rng.normal(size=(12, 3)) * scale) for _ in "ab")
        R_A, R_B, p = rotation(rng), rotation(rng), rng.normal(size=3) * 0.7
        c = contact(a, b, p, R_A, R_B)
        # check the answer by the definitions: the gap exists, and the witness points are in the hulls
        assert abs(projected_gap(a, b, p, R_A, R_B, c.normal) - c.distance) <= c.bound + 1e-12
        swapped = contact(b, a, -p, R_B, R_A)
        assert abs(swapped.distance - c.distance) <= c.bound + swapped.bound + 1e-12
        if c.distance > 0:
            apart += 1
            for shape, point, R in ((a, c.point_a, R_A), (b, c.point_b - p, R_B)):
                # in the hull: no direction along which the point is farther than all corners
                directions = np.vstack([rng.normal(size=(200, 3)), c.normal, -c.normal, R.T])
                assert ((directions @ point) <= (directions @ R @ shape.points.T).max(axis=1) + 1e-9).all()
        else:
            # a short translation separates thin shapes: along the thin axis of one of them
            normals = [R[:, 2] for R in (R_A, R_B)] + [np.cross(R_A[:, 0], R_B[:, 0])]
            ways = [projected_gap(a, b, p, R_A, R_B, s * n / np.linalg.norm(n)) for n in normals for s in (1, -1)]
            assert c.distance >= max(ways) - c.bound - 1e-12
    assert apart > 2


def test_points_that_are_doubled_or_in_a_face_change_nothing():
    middles = np.array([c for c in product((-0.5, 0.0, 0.5), repeat=3) if any(c)])
    rng = np.random.default_rng(3)
    crowded = ConvexHull(rng.permutation(np.vstack([CUBE, CUBE, middles, middles])))
    for _ in range(30):
        R_A, R_B, p = rotation(rng), rotation(rng), rng.normal(size=3)
        expected = contact(Box((1, 1, 1)), Box((1, 1, 1)), p, R_A, R_B)
        c = contact(crowded, crowded, p, R_A, R_B)
        assert c.distance == pytest.approx(expected.distance, abs=expected.bound + 1e-12)


KINDS = [Sphere(0.5), Box((1, 1, 1)), Capsule(0.3, 0.8), Cylinder(0.5, 1), Cone(0.5, 1), ConvexHull(CUBE)]


@pytest.mark.parametrize(("a", "b"), list(combinations_with_replacement(KINDS, 2)), ids=lambda s: type(s).__name__)
def test_in_the_same_place(a, b):
    """Identical poses: the shapes are deep in each other, and the answer separates them."""
    for R in (EYE, rotation(np.random.default_rng(4))):
        c = contact(a, b, (0, 0, 0), R, R)
        assert -(size(a) + size(b)) <= c.distance < -0.1
        assert abs(projected_gap(a, b, np.zeros(3), R, R, c.normal) - c.distance) <= c.bound + 1e-12


@pytest.mark.parametrize("flip", [(-1, 1, 1), (1, -1, 1), (-1, -1, -1)])
def test_mirrored_shapes_have_mirrored_answers(flip):
    rng, flip = np.random.default_rng(5), np.array(flip, float)
    for _ in range(20):
        a, b, p = rng.normal(size=(8, 3)), rng.normal(size=(9, 3)), rng.normal(size=3) * 2
        c = contact(ConvexHull(a), ConvexHull(b), p)
        m = contact(ConvexHull(a * flip), ConvexHull(b * flip), p * flip)
        assert m.distance == pytest.approx(c.distance, abs=c.bound + m.bound)
        if c.distance > 1e-3:
            np.testing.assert_allclose(m.normal, c.normal * flip, atol=1e-9)
            np.testing.assert_allclose(m.point_b, c.point_b * flip, atol=1e-9)


@pytest.mark.parametrize("p", [(1, 1, 1), (1, 1, 0.25), (1, 0.25, 0.125)], ids=["corner", "edge", "face"])
@pytest.mark.parametrize("turn", [0, 1, 2])
def test_touching_exactly(p, turn):
    p = np.roll(p, turn)
    for a in (Box((1, 1, 1)), ConvexHull(CUBE)):
        for b in (Box((1, 1, 1)), ConvexHull(CUBE)):
            c = contact(a, b, p)
            assert abs(c.distance) <= c.bound <= 1e-8
            assert (np.abs(c.point_a) <= 0.5 + 1e-9).all() and (np.abs(c.point_b - p) <= 0.5 + 1e-9).all()


def two_cubes(shift):
    """Two cubes as one mesh that share coinciding corners: an edge of four faces, or a common corner."""
    corners = np.vstack([CUBE, CUBE + shift])
    quads = np.array([[1, 3, 7, 5], [0, 4, 6, 2], [2, 6, 7, 3], [0, 1, 5, 4], [4, 5, 7, 6], [0, 2, 3, 1]])
    order = np.array([0, 4, 2, 6, 1, 5, 3, 7])  # order of a box's corners: x first
    faces = order[quads][:, [[0, 1, 2], [0, 2, 3]]].reshape(-1, 3)
    vertices, index = np.unique(corners, axis=0, return_inverse=True)
    return Mesh(vertices, index.ravel()[np.vstack([faces, faces + 8])])


@pytest.mark.parametrize("shift", [(1, 1, 0), (1, 1, 1), (3, 0, 0)], ids=["edge", "corner", "apart"])
def test_meshes_that_are_no_manifold_are_their_solids(shift):
    mesh = two_cubes(np.array(shift, float))
    boxes = [(Box((1, 1, 1)), cm.Pose()), (Box((1, 1, 1)), cm.Pose(shift))]
    ball, rng = Sphere(0.2), np.random.default_rng(6)
    seen = set()
    for _ in range(30):
        Y = cm.Pose(rng.uniform(-1, 2.5, 3))
        c, expected = cm.contact(mesh, cm.Pose(), ball, Y), cm.contact(boxes, cm.Pose(), ball, Y)
        seen.add(expected.overlaps)
        assert c.overlaps == expected.overlaps
        if not expected.overlaps:
            assert c.signed_distance == pytest.approx(expected.signed_distance, abs=1e-12)
    assert seen == {True, False}
    # without one face the mesh is a surface without an inside
    sheet = Mesh(mesh.vertices, mesh.faces[1:])
    assert not cm.contact(sheet, cm.Pose(), Sphere(0.1), cm.Pose()).overlaps
    assert cm.contact(mesh, cm.Pose(), Sphere(0.1), cm.Pose()).overlaps


@pytest.mark.parametrize("length", [1e4, 1e8, 1.5e10, 1e12])
def test_a_needle_of_any_length_has_a_direction(length):
    """A ball on the axis of a long ellipsoid leaves it sideways, over its smallest half axis."""
    needle, ball, rng = cm.Ellipsoid((0.8, length, 1.03)), Sphere(0.5), np.random.default_rng(7)
    for _ in range(20):
        q = rng.normal(size=4)
        X = cm.Pose(rng.normal(size=3), q / np.linalg.norm(q))
        for c in (cm.contact(needle, X, ball, X), cm.contact(ball, X, needle, X)):
            assert abs(np.linalg.norm(c.normal) - 1.0) < 1e-12
            assert np.isfinite([c.signed_distance, c.error_bound, *c.point_a, *c.point_b]).all()
            assert abs(c.signed_distance + 1.3) <= c.error_bound
