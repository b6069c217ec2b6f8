"""Tests between bounding volumes, against rational numbers, sampling and clipping."""

from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from point_sets import SETS, rotation
from rational import POINTS_3D
from scipy.optimize import linprog

from collision_monitor.errors import InputError, ShapeError
from collision_monitor.geometry.bounding_volumes import Aabb, BoundingSphere, Obb, aabb, kdop_of_points
from collision_monitor.geometry.lecture.bounding_tests import (
    aabb_aabb,
    circle_circle,
    closest_point_in_aabb,
    kdop_kdop,
    obb_obb,
    obb_polygon,
    sphere_aabb,
    sphere_obb,
    spheres_overlap,
)
from collision_monitor.geometry.triangulation import triangulate

RADII = st.integers(0, 5)


def sphere(center, radius):
    return BoundingSphere(np.array(center, float), np.array(radius, float))


@given(POINTS_3D, RADII, POINTS_3D, RADII, st.integers(-30, 30))
def test_spheres_and_circles(p, r, q, s, exponent):
    scale = 2.0**exponent
    distance2 = sum((x - y) ** 2 for x, y in zip(p, q, strict=True))
    a, b = sphere(np.array(p) * scale, r * scale), sphere(np.array(q) * scale, s * scale)
    assert spheres_overlap(a, b) == spheres_overlap(b, a) == (distance2 <= (r + s) ** 2)
    flat2 = sum((x - y) ** 2 for x, y in zip(p[:2], q[:2], strict=True))
    assert circle_circle(sphere(p[:2], r), sphere(q[:2], s)) == (flat2 <= (r + s) ** 2)


def test_circles_are_in_the_plane():
    with pytest.raises(InputError, match=r"\(\.\.\., 2\)"):
        circle_circle(sphere([0, 0, 0], 1), sphere([0, 0, 0], 1))


@given(POINTS_3D, POINTS_3D, POINTS_3D, POINTS_3D)
def test_aabbs(p, q, r, s):
    a, b = aabb([p, q]), aabb([r, s])
    apart = any(max(p[k], q[k]) < min(r[k], s[k]) or max(r[k], s[k]) < min(p[k], q[k]) for k in range(3))
    assert aabb_aabb(a, b) == aabb_aabb(b, a) == (not apart)


@given(POINTS_3D, RADII, POINTS_3D, POINTS_3D)
def test_sphere_against_aabb(p, r, q, s):
    box = aabb([q, s])
    lower, upper = np.minimum(q, s), np.maximum(q, s)
    gap2 = sum(Fraction(max(lower[k] - p[k], p[k] - upper[k], 0)) ** 2 for k in range(3))
    overlap, closest = sphere_aabb(sphere(p, r), box)
    assert overlap == (gap2 <= r * r)
    assert sum((Fraction(x) - y) ** 2 for x, y in zip(closest.tolist(), p, strict=True)) == gap2
    turned, where = sphere_obb(sphere(p, r), Obb((box.lower + box.upper) / 2, np.eye(3), (box.upper - box.lower) / 2))
    assert turned == overlap and (where == closest).all()


@settings(max_examples=25)
@given(st.integers(0, 2**32 - 1))
def test_sphere_against_obb_is_the_same_in_every_frame(seed):
    rng = np.random.default_rng(seed)
    half, p, shift = rng.uniform(0.1, 2, 3), rng.normal(size=3) * 2, rng.normal(size=3) * 100
    turn = rotation(seed)
    gap = np.linalg.norm(np.maximum(np.abs(p) - half, 0))
    box = Obb(shift, turn, half)
    for radius, expected in ((gap + 1e-12, True), (gap - 1e-12, gap == 0)):
        if radius >= 0:
            assert sphere_obb(sphere(turn @ p + shift, radius), box)[0] == expected
    closest = sphere_obb(sphere(turn @ p + shift, 1), box)[1]
    assert np.abs(closest - (turn @ np.clip(p, -half, half) + shift)).max() < 1e-12


FEW = st.lists(POINTS_3D, min_size=1, max_size=5)


@given(FEW, FEW, st.sampled_from([6, 14, 18, 26]))
def test_kdops(a, b, k):
    first, second = kdop_of_points(a, k), kdop_of_points(b, k)
    normals = np.round(first.directions / np.abs(first.directions).max(axis=1, keepdims=True)).astype(int)
    dots_a, dots_b = normals @ np.array(a).T, normals @ np.array(b).T
    apart = (dots_a.max(axis=1) < dots_b.min(axis=1)) | (dots_b.max(axis=1) < dots_a.min(axis=1))
    assert kdop_kdop(first, second) == kdop_kdop(second, first) == (not apart.any())


def test_kdops_of_different_directions_are_refused():
    with pytest.raises(InputError, match="same directions"):
        kdop_kdop(kdop_of_points(SETS["cube"], 6), kdop_of_points(SETS["cube"], 14))


def test_arrays_of_volumes():
    rng = np.random.default_rng(0)
    centers, radii = rng.normal(size=(6, 1, 3)), rng.uniform(0, 1, (6, 1))
    a, b = BoundingSphere(centers, radii), BoundingSphere(rng.normal(size=(4, 3)), rng.uniform(0, 1, 4))
    assert spheres_overlap(a, b).shape == (6, 4)
    boxes = Aabb(np.zeros((4, 3)), rng.uniform(0, 1, (4, 3)))
    overlap, closest = sphere_aabb(a, boxes)
    assert overlap.shape == (6, 4) and closest.shape == (6, 4, 3)
    assert aabb_aabb(boxes, Aabb(boxes.lower[:, None], boxes.upper[:, None])).all()
    obbs = Obb(np.zeros((4, 3)), np.stack([rotation(k) for k in range(4)]), rng.uniform(0, 1, (4, 3)))
    assert sphere_obb(a, obbs)[0].shape == (6, 4) and obbs.corners.shape == (4, 8, 3)
    assert closest_point_in_aabb([5, 5, 5], boxes).tolist() == boxes.upper.tolist()


def box_meets_triangle(half, triangle):
    """Whether a point of the triangle is in the box, by linear programming over its barycentric coordinates."""
    inside = np.vstack([triangle.T, -triangle.T])
    answer = linprog(np.zeros(3), inside, np.concatenate([half, half]), np.ones((1, 3)), [1], bounds=(0, None))
    return answer.status == 0


@settings(max_examples=40)
@given(st.tuples(*[POINTS_3D] * 3), st.tuples(*[st.integers(1, 5)] * 3), st.integers(0, 99))
def test_obb_against_triangles(points, half, seed):
    triangle, half = np.array(points, float), np.array(half) / 2
    if np.linalg.norm(np.cross(triangle[1] - triangle[0], triangle[2] - triangle[0])) == 0:
        return
    turn, shift = rotation(seed), np.random.default_rng(seed).normal(size=3)
    moved = triangle @ turn.T + shift
    # a tolerance of 1e-6 to each side, the accuracy of linear programming
    assert obb_polygon(Obb(shift, turn, half + 1e-6), moved) >= box_meets_triangle(half, triangle)
    assert obb_polygon(Obb(shift, turn, half - 1e-6), moved) <= box_meets_triangle(half, triangle)


def boxes_meet(a, b):
    """Whether a point is in both boxes, by linear programming over its coordinates in each."""
    equal = np.hstack([a.rotation, -b.rotation])
    limits = [(-h, h) for h in (*a.half_extents, *b.half_extents)]
    return linprog(np.zeros(6), A_eq=equal, b_eq=b.center - a.center, bounds=limits).status == 0


@settings(max_examples=60)
@given(st.integers(0, 2**32 - 1))
def test_obbs(seed):
    rng = np.random.default_rng(seed)
    turns = rotation(seed), rotation(seed) if seed % 4 == 0 else rotation(seed + 1)  # in one of four, equal axes
    a, b = (Obb(rng.normal(size=3), turn, 10.0 ** rng.uniform(-1, 0.3, 3)) for turn in turns)
    larger, smaller = (a._replace(half_extents=a.half_extents + s) for s in (1e-6, -1e-6))
    assert obb_obb(larger, b) == obb_obb(b, larger)
    assert obb_obb(larger, b) >= boxes_meet(a, b)
    assert obb_obb(smaller, b) <= boxes_meet(a, b)


def test_crossed_bars_are_parted_by_their_edges_alone():
    """Two thin bars, turned about different axes, so that no face normal is a separating axis."""
    up, across = np.sqrt(0.5) * np.array([[1, -1], [1, 1]]), np.eye(3)
    about_x, about_y = across.copy(), across.copy()
    about_x[1:, 1:], about_y[::2, ::2] = up, up
    first = Obb(np.zeros(3), about_x, np.array([3, 1, 1.0]))
    second = Obb(np.array([0, 0, 2 * np.sqrt(2) + 0.01]), about_y, np.array([1, 3, 1.0]))
    assert not obb_obb(first, second)
    assert obb_obb(first, second._replace(center=second.center - [0, 0, 0.02]))
    many = Obb(np.stack([second.center, second.center - [0, 0, 0.02]]), about_y, second.half_extents)
    assert obb_obb(first, many).tolist() == [False, True]


@settings(max_examples=20)
@given(st.integers(0, 2**32 - 1))
def test_obb_against_concave_polygons(seed):
    rng = np.random.default_rng(seed)
    angle = 2 * np.pi * (np.arange(9) + rng.uniform(0, 0.9, 9)) / 9
    star = rng.uniform(0.2, 2, 9) * np.array([np.cos(angle), np.sin(angle)])
    turn, shift, half = rotation(seed), rng.normal(size=3), rng.uniform(0.05, 0.5, 3)
    polygon = np.vstack([star, np.zeros(9)]).T @ turn.T
    box = Obb(shift, rotation(seed + 1), half)
    in_box = (polygon - shift) @ box.rotation
    expected = any(box_meets_triangle(half, in_box[t]) for t in triangulate(star.T))
    assert obb_polygon(box, polygon) == obb_polygon(box, polygon[::-1]) == expected


def test_a_box_between_the_arms_of_a_polygon():
    fork = np.array([[0, 0, 0], [3, 0, 0], [3, 3, 0], [2, 3, 0], [2, 1, 0], [1, 1, 0], [1, 3, 0], [0, 3, 0]], float)
    box = Obb(np.array([1.5, 2.5, 0.2]), np.eye(3), np.array([0.4, 0.4, 0.4]))
    assert not obb_polygon(box, fork)
    assert obb_polygon(box, fork[[0, 1, 2, 7]])
    assert obb_polygon(box._replace(half_extents=np.array([0.5, 0.4, 0.4])), fork)  # touching


def test_a_corner_below_a_wide_polygon_is_parted_by_the_polygons_own_normal():
    box = Obb(np.zeros(3), np.eye(3), np.ones(3))
    u, v = np.array([1, -1, 0]), np.array([1, 1, -2])
    wide = np.array([50 * u, -50 * u, 50 * v]) - 10 * v
    assert not obb_polygon(box, wide + 1.01)  # the plane x + y + z = 3.03
    assert obb_polygon(box, wide + 1.0)  # through the box's corner
    assert obb_polygon(box, wide + 0.99)


def test_polygons_that_are_none_are_refused():
    box = Obb(np.zeros(3), np.eye(3), np.ones(3))
    with pytest.raises(ShapeError, match="one plane"):
        obb_polygon(box, [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0.5]])
    with pytest.raises(ShapeError, match="one line"):
        obb_polygon(box, [[0, 0, 0], [1, 1, 1], [2, 2, 2]])
    with pytest.raises(ShapeError, match="finite"):
        obb_polygon(box, [[0, 0, 0], [1, 1, np.nan], [2, 2, 2]])
