"""GJK and EPA against brute force over all Minkowski faces; cylinders and cones against known answers."""

from __future__ import annotations

import numpy as np
import pytest
from minkowski import polytope_signed_distance, rotation
from pairs import EYE, contact, points_of, projected_gap, support

from collision_monitor.shapes.registry import Box, Capsule, Cone, ConvexHull, Cylinder, Sphere


def random_hull(rng):
    return ConvexHull(rng.normal(size=(rng.integers(4, 24), 3)) * rng.uniform(0.3, 1.5, 3))


def random_box(rng):
    return Box(rng.uniform(0.1, 2, 3))


@pytest.mark.parametrize("spread", [0.1, 0.8, 2.0])
@pytest.mark.parametrize("make_b", [random_hull, random_box])
def test_polytopes_against_the_minkowski_difference(make_b, spread):
    rng = np.random.default_rng(7)
    for _ in range(40):
        a, b = random_hull(rng), make_b(rng)
        R_A, R_B, p = rotation(rng), rotation(rng), rng.normal(size=3) * spread
        c = contact(a, b, p, R_A, R_B)
        expected = polytope_signed_distance(points_of(a) @ R_A.T, points_of(b) @ R_B.T + p)
        assert abs(c.distance - expected) <= 1e-12
        assert abs(c.distance - expected) <= c.bound
        assert abs(projected_gap(a, b, p, R_A, R_B, c.normal) - c.distance) <= 1e-11
        assert c.point_a @ c.normal == pytest.approx(support(a, R_A, c.normal), abs=1e-11)
        if c.distance > 0:
            assert c.gap == pytest.approx(c.distance, abs=1e-11)


def test_witness_points_are_on_both_hulls():
    from scipy.spatial import ConvexHull as Qhull

    rng = np.random.default_rng(8)
    for _ in range(60):
        a, b = random_hull(rng), random_hull(rng)
        p = rng.normal(size=3)
        c = contact(a, b, p)
        for shape, point in ((a, c.point_a), (b, c.point_b - p)):
            equations = Qhull(shape.points).equations
            assert abs((equations[:, :3] @ point + equations[:, 3]).max()) < 1e-11


def test_box_as_hull_answers_as_the_box():
    rng = np.random.default_rng(9)
    for _ in range(60):
        a, b = random_box(rng), random_box(rng)
        ha, hb = ConvexHull(points_of(a)), ConvexHull(points_of(b))
        R_A, R_B, p = rotation(rng), rotation(rng), rng.normal(size=3)
        expected = contact(a, b, p, R_A, R_B).distance
        for x, y in ((ha, hb), (a, hb), (ha, b)):
            assert contact(x, y, p, R_A, R_B).distance == pytest.approx(expected, abs=1e-9)


@pytest.mark.parametrize(
    "p", [(0, 0, 0), (0.5, 0, 0), (1, 0, 0), (1, 1, 0), (1, 1, 1), (0.3, 0.3, 0.3), (0, 0, 1 - 1e-13)]
)
def test_aligned_cubes_with_coplanar_faces(p):
    cube = Box((1, 1, 1))
    hull = ConvexHull(points_of(cube))
    expected = contact(cube, cube, p)
    for x, y in ((hull, hull), (cube, hull)):
        c = contact(x, y, p)
        assert c.distance == pytest.approx(expected.distance, abs=1e-12)
        assert abs(projected_gap(x, y, p, EYE, EYE, c.normal) - c.distance) < 1e-11


def test_capsule_against_polytopes():
    rng = np.random.default_rng(10)
    for _ in range(60):
        r, half = rng.uniform(0.1, 0.6, 2)
        b = random_box(rng) if rng.random() < 0.5 else random_hull(rng)
        R_A, R_B, p = rotation(rng), rotation(rng), rng.normal(size=3)
        core = np.array([[0, 0, -half], [0, 0, half]])
        expected = polytope_signed_distance(core @ R_A.T, points_of(b) @ R_B.T + p) - r
        c = contact(Capsule(r, 2 * half), b, p, R_A, R_B)
        assert c.distance == pytest.approx(expected, abs=1e-11)
        expected = polytope_signed_distance(np.zeros((1, 3)), points_of(b) @ R_B.T + p) - r
        assert contact(Sphere(r), b, p, R_A, R_B).distance == pytest.approx(expected, abs=1e-11)


@pytest.mark.parametrize("make_a", [lambda r: Cylinder(*r.uniform(0.2, 1, 2)), lambda r: Cone(*r.uniform(0.2, 1, 2))])
@pytest.mark.parametrize("make_b", [random_box, lambda r: Cylinder(*r.uniform(0.2, 1, 2)), random_hull])
def test_curved_shapes_against_prisms(make_a, make_b):
    """The inscribed 48-gon lacks 1 - cos(pi / 48) = 0.2 % of the radius, which bounds the difference."""
    rng = np.random.default_rng(11)
    sides = 48
    for _ in range(12):
        a, b = make_a(rng), make_b(rng)
        R_A, R_B, p = rotation(rng), rotation(rng), rng.normal(size=3) * 0.6
        c = contact(a, b, p, R_A, R_B)
        inscribed = polytope_signed_distance(points_of(a, sides) @ R_A.T, points_of(b, sides) @ R_B.T + p)
        missing = (1 - np.cos(np.pi / sides)) * (a.radius + getattr(b, "radius", 0))
        assert inscribed - missing - 1e-6 <= c.distance <= inscribed + 1e-6
        assert c.bound <= 5e-6
        assert abs(projected_gap(a, b, p, R_A, R_B, c.normal) - c.distance) <= c.bound + 1e-9


def test_witness_points_are_on_both_round_surfaces():
    rng = np.random.default_rng(19)
    apart = 0
    for _ in range(150):
        a, b = Cylinder(*rng.uniform(0.2, 1, 2)), Cone(*rng.uniform(0.2, 1, 2))
        R_A, R_B, p = rotation(rng), rotation(rng), rng.normal(size=3)
        c = contact(a, b, p, R_A, R_B)
        if c.distance > 0:
            x, y, z = c.point_a @ R_A
            assert max(np.hypot(x, y) - a.radius, abs(z) - a.length / 2) == pytest.approx(0, abs=1e-9)
            x, y, z = (c.point_b - p) @ R_B
            slant = np.hypot(b.radius, b.length)
            side = (np.hypot(x, y) * b.length + (z - b.length / 2) * b.radius) / slant
            assert max(side, -z - b.length / 2) == pytest.approx(0, abs=1e-9)
            apart += 1
    assert apart > 50


def test_cylinders_and_cones_that_are_known():
    can = Cylinder(0.5, 2)
    assert contact(can, can, (1.5, 0, 0.3)).distance == pytest.approx(0.5, abs=1e-9)
    assert contact(can, can, (0, 0, 2.25)).distance == pytest.approx(0.25, abs=1e-9)
    assert contact(can, can, (3, 4, 0.3)).distance == pytest.approx(4, abs=1e-9)
    assert contact(can, can, (0.9, 0, 0.3)).distance == pytest.approx(-0.1, abs=4e-6)
    assert contact(can, can).distance == pytest.approx(-1, abs=4e-6)
    assert contact(can, Sphere(0.25), (1, 0, 0)).distance == pytest.approx(0.25, abs=1e-9)
    assert contact(can, Sphere(0.25), (0.5 + 3, 0, 1 + 4)).distance == pytest.approx(4.75, abs=1e-9)
    cone = Cone(1, 2)
    assert contact(cone, Box((2, 2, 2)), (0, 0, 2.5)).distance == pytest.approx(0.5, abs=1e-9)
    assert contact(cone, Box((2, 2, 2)), (0, 0, -1.75)).distance == pytest.approx(-0.25, abs=4e-6)


@pytest.mark.parametrize("gap", [1e-3, 1e-6, 1e-9, 1e-12, 0.0, -1e-12, -1e-9, -1e-6, -1e-3])
def test_depth_runs_through_zero_without_a_jump(gap):
    rng = np.random.default_rng(12)
    for _ in range(8):
        a, b = random_hull(rng), random_hull(rng)
        n = rng.normal(size=3)
        n /= np.linalg.norm(n)
        p = n * 4
        far = contact(a, b, p)
        closer = contact(a, b, p - (far.distance - gap) * far.normal)
        if gap >= 0:
            assert closer.distance == pytest.approx(gap, abs=1e-9)
        else:  # a corner that is 1 mm deep along one normal is less deep along a face's normal
            assert gap - 1e-9 <= closer.distance <= 1e-9


def test_flat_differences():
    """Two coplanar plates, a needle in a plate: B - A has no volume."""
    s = np.sqrt(0.5)
    R = np.array([[s, -s, 0], [s, s, 0], [0, 0, 1]])
    plate = Box((1, 1, 0))
    tilt = rotation(np.random.default_rng(13))
    for capsule_p in ((0, 0, 0), (0.2, 0.1, 0)):
        core_in_plane = tilt @ np.array([[0, 0, 1], [1, 0, 0], [0, 1, 0.0]])
        c = contact(plate, Capsule(0.1, 0.3), tilt @ capsule_p, tilt, core_in_plane)
        assert c.distance == pytest.approx(-0.1, abs=1e-9)
        np.testing.assert_allclose(np.abs(c.normal @ tilt[:, 2]), 1, atol=1e-9)
    c = contact(plate, plate, (0.2, 0.1, 0), EYE, R)
    assert c.distance == pytest.approx(0, abs=1e-12)


@pytest.mark.parametrize("scale", [1e-9, 1e-4, 1e9])
def test_scale(scale):
    rng = np.random.default_rng(14)
    for _ in range(20):
        a, b, p = random_hull(rng), random_hull(rng), rng.normal(size=3)
        one = contact(a, b, p)
        other = contact(ConvexHull(a.points * scale), ConvexHull(b.points * scale), p * scale)
        assert other.distance / scale == pytest.approx(one.distance, abs=1e-11)


def test_many_vertices_end_with_an_honest_bound():
    rng = np.random.default_rng(15)
    ball = rng.normal(size=(400, 3))
    ball /= np.linalg.norm(ball, axis=1, keepdims=True)
    a = ConvexHull(ball)
    c = contact(a, a)
    assert -2.0 <= c.distance <= -1.8
    assert abs(projected_gap(a, a, np.zeros(3), EYE, EYE, c.normal) - c.distance) < 1e-9
    assert c.bound < 0.1


def as_polygon(shape, R, p, sides):
    return points_of(shape, sides) @ R.T + p


def test_sphere_against_cylinder_and_cone_by_the_definition():
    rng = np.random.default_rng(16)
    sides = 400
    for _ in range(25):
        radius, height, r = rng.uniform(0.2, 1, 3)
        R, p = rotation(rng), rng.normal(size=3) * 0.8
        for shape in (Cylinder(radius, height), Cone(radius, height)):
            c = contact(Sphere(r), shape, p, EYE, R)
            inscribed = polytope_signed_distance(np.zeros((1, 3)), as_polygon(shape, R, p, sides)) - r
            assert inscribed - 4e-5 * radius <= c.distance <= inscribed + 1e-12
            assert projected_gap(Sphere(r), shape, p, EYE, R, c.normal) == pytest.approx(c.distance, abs=1e-12)
            assert c.bound < 1e-9


def test_parallel_cylinders_and_capsules():
    rng = np.random.default_rng(17)
    for _ in range(60):
        a = (Cylinder if rng.random() < 0.5 else Capsule)(*rng.uniform(0.2, 1, 2))
        b = Cylinder(*rng.uniform(0.2, 1, 2))
        R, p = rotation(rng), rng.normal(size=3) * 0.8
        R_A = R @ np.diag([1, -1, -1]) if rng.random() < 0.5 else R
        c = contact(a, b, p, R_A, R)
        tilt = np.array([[1, 0, 0], [0, np.cos(1e-7), -np.sin(1e-7)], [0, np.sin(1e-7), np.cos(1e-7)]])
        tilted = contact(a, b, p, R_A @ tilt, R)
        assert c.distance == pytest.approx(tilted.distance, abs=2e-6)
        assert projected_gap(a, b, p, R_A, R, c.normal) == pytest.approx(c.distance, abs=1e-9)
        assert c.bound < 1e-8
