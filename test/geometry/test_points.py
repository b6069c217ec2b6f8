"""Tests of points against points, segments and planes."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from rational import EXPONENTS, POINTS_2D, POINTS_3D, on_segment

from collision_monitor.errors import InputError, ShapeError
from collision_monitor.geometry.points import (
    closest_point_on_segment,
    crossing_time,
    height_above_ground,
    plane,
    plane_from_points,
    point_on_segment,
    points_coincide,
    signed_distance,
)

THIRDS = st.integers(0, 3)


def test_points_coincide_within_the_threshold_in_any_direction():
    assert points_coincide([0, 0], [3, 4], 5.0)
    assert not points_coincide([0, 0], [3, 4], 4.999)
    assert not points_coincide([-9, -9], [0, 0], 1.0)  # the slide's difference without absolute value accepts this pair
    assert points_coincide([1, 2, 3], [1, 2, 3])
    assert points_coincide(np.zeros((4, 1, 3)), np.ones((5, 3)), 1.8).shape == (4, 5)


@given(st.tuples(POINTS_2D, POINTS_2D, POINTS_2D), EXPONENTS)
def test_point_on_segment_2d(points, exponent):
    p, a, b = np.array(points) * 2.0**exponent
    assert point_on_segment(p, a, b) == point_on_segment(p, b, a) == on_segment(p, a, b)


@given(st.tuples(POINTS_3D, POINTS_3D), st.integers(-4, 8), POINTS_3D, st.booleans())
def test_point_on_segment_3d(ends, quarters, other, use_other):
    a, b = np.array(ends, float)
    p = np.array(other) if use_other else a + quarters / 4 * (b - a)
    assert point_on_segment(p, a, b) == on_segment(p, a, b)


def test_point_on_segment_where_the_slides_parameters_fail():
    assert point_on_segment([2, 5], [2, 1], [2, 9])  # t_x = 0 / 0
    a, b = np.array([0.1, 0.2]), np.array([0.7, 0.9])
    p = a + 0.3 * (b - a)
    assert not point_on_segment(p, a, b)  # round-off puts p beside the segment, and the test is exact
    assert point_on_segment(p, a, b, tolerance=1e-15)


@given(st.tuples(POINTS_3D, POINTS_3D, POINTS_3D), EXPONENTS)
def test_closest_point_on_segment_beats_a_fine_sampling(points, exponent):
    p, a, b = np.array(points) * 2.0**exponent
    closest, t = closest_point_on_segment(p, a, b)
    assert 0 <= t <= 1
    sampled = np.linalg.norm(a + np.linspace(0, 1, 101)[:, None] * (b - a) - p, axis=1).min()
    assert np.linalg.norm(closest - p) <= sampled * (1 + 1e-14)
    assert np.linalg.norm(closest - (a + t * (b - a))) <= 1e-15 * 10 * 2.0**exponent


def test_ground():
    assert height_above_ground([[0, 0, 2], [0, 0, -1]], 0.5).tolist() == [1.5, -1.5]


def test_plane_from_points_looks_at_the_side_from_which_they_run_counter_clockwise():
    found = plane_from_points([0, 0, 5], [1, 0, 5], [0, 1, 5])
    assert found.normal.tolist() == [0, 0, 1]
    assert found.d == -5  # a x + b y + c z + d = 0
    assert signed_distance([7, 8, 6], found) == 1
    assert signed_distance([7, 8, 3], found) == -2


@settings(max_examples=25)
@given(st.integers(0, 2**32 - 1), st.integers(-9, 9))
def test_the_three_points_are_on_their_plane(seed, exponent):
    points = np.random.default_rng(seed).normal(size=(3, 5, 3)) * 10.0**exponent
    found = plane_from_points(*points)
    assert np.abs(np.linalg.norm(found.normal, axis=-1) - 1).max() < 1e-15
    assert np.abs(signed_distance(points, found)).max() < 1e-13 * 10.0**exponent


def test_a_plane_far_from_the_origin_loses_nothing():
    far = np.array([1e9, -1e9, 1e9])
    found = plane_from_points(far, far + np.array([1, 0, 0]), far + np.array([0, 1, 0]))
    assert signed_distance(far + np.array([0, 0, 0.25]), found) == 0.25


@pytest.mark.parametrize(
    "points",
    [
        [[0, 0, 0], [0, 0, 0], [1, 0, 0]],
        [[0, 0, 0], [1, 2, 3], [2, 4, 6]],
        [[0.1, 0.1, 0.1], [0.2, 0.2, 0.2], [0.7, 0.7, 0.7]],
        [[1, 1, 1], [1, 1, 1], [1, 1, 1]],
    ],
)
def test_points_on_one_line_have_no_plane(points):
    with pytest.raises(ShapeError, match="one line"):
        plane_from_points(*points)


def test_crossing_time():
    ground = plane([0, 0, 2], [0, 0, 1])
    start = [[0, 0, 5], [0, 0, 1], [0, 0, 3], [0, 0, 0], [0, 0, 3], [1, 0, 1]]
    end = [[0, 0, -3], [0, 0, 9], [0, 0, 2], [0, 0, 2], [0, 0, 1], [2, 0, 1]]
    assert np.array_equal(crossing_time(start, end, ground), [0.5, 0, np.nan, 0.5, 1, 0], equal_nan=True)


@settings(max_examples=25)
@given(st.integers(0, 2**32 - 1))
def test_the_point_is_on_the_plane_at_the_crossing_time(seed):
    rng = np.random.default_rng(seed)
    through = plane(rng.normal(size=(20, 3)), rng.normal(size=(20, 3)))
    start, end = rng.normal(size=(20, 3)), rng.normal(size=(20, 3))
    t = crossing_time(start, end, through)
    crosses = np.sign(signed_distance(start, through)) != np.sign(signed_distance(end, through))
    assert np.array_equal(~np.isnan(t), crosses)
    where = start + t[:, None] * (end - start)
    assert np.abs(np.where(crosses, ((where - through.point) * through.normal).sum(axis=-1), 0)).max() < 1e-14


@pytest.mark.parametrize(
    "bad", [[np.nan, 0, 0], [np.inf, 0, 0], [], [[]], 5.0, ["a", "b", "c"], [1, 2, 3, 4], np.zeros((0, 3))]
)
def test_bad_points_are_refused(bad):
    with pytest.raises(InputError, match="expected"):
        points_coincide(bad, [0, 0, 0], 1.0)
    with pytest.raises(InputError, match="expected"):
        point_on_segment([0, 0, 0], bad, [0, 0, 0])


def test_bad_thresholds_and_normals_are_refused():
    with pytest.raises(InputError, match="threshold"):
        points_coincide([0, 0], [0, 0], -1.0)
    with pytest.raises(InputError, match="threshold"):
        points_coincide([0, 0], [0, 0], np.nan)
    with pytest.raises(ShapeError, match="zero vector"):
        plane([0, 0, 0], [1, 2, 3])
