"""Tests of closest points against the slide's least squares, sampling and scipy's bounded minimiser."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from rational import POINTS_3D
from scipy.optimize import lsq_linear

from collision_monitor.errors import InputError
from collision_monitor.geometry.lecture.closest_points import closest_points
from collision_monitor.geometry.lines import LineKind

LINE, RAY, SEGMENT = LineKind.LINE, LineKind.RAY, LineKind.SEGMENT
FOUR = st.tuples(POINTS_3D, POINTS_3D, POINTS_3D, POINTS_3D)
EXTENTS = st.sampled_from(list(LineKind))


def test_the_slides_normal_equations():
    rng = np.random.default_rng(0)
    c1, d1, c2, d2 = rng.normal(size=(4, 3))
    A = np.array([[d1 @ d1, -d1 @ d2], [d2 @ d1, -d2 @ d2]])
    b = np.array([-d1 @ (c1 - c2), -d2 @ (c1 - c2)])
    found = closest_points(c1, d1, c2, d2, LINE, LINE)
    assert np.allclose([found.alpha, found.beta], np.linalg.solve(A, b), rtol=1e-12)
    assert np.allclose(found.intersection, (c1 + found.alpha * d1 + c2 + found.beta * d2) / 2, rtol=1e-14)


@settings(max_examples=60)
@given(FOUR, EXTENTS, EXTENTS, st.integers(-9, 9))
def test_no_pair_of_points_is_closer(points, first, second, exponent):
    p, u, q, v = np.array(points, float)
    scale = 10.0**exponent
    found = closest_points(p * scale, u * scale, q * scale, v * scale, first, second)
    assert first.value[0] <= found.alpha <= first.value[1] and second.value[0] <= found.beta <= second.value[1]
    assert np.allclose(found.point_a, (p + found.alpha * u) * scale, rtol=1e-14, atol=1e-14 * scale)
    assert np.allclose(found.point_b, (q + found.beta * v) * scale, rtol=1e-14, atol=1e-14 * scale)
    bounds = np.clip(np.array([first.value, second.value]).T, -1e6, 1e6)
    A = np.column_stack([u, -v])
    reference = np.linalg.norm(A @ lsq_linear(A, q - p, bounds, tol=1e-15).x - (q - p))
    assert found.distance <= (reference + 1e-13) * scale
    apart = np.linalg.norm(found.point_a - found.point_b)
    assert abs(found.distance - apart) <= 1e-13 * scale


@given(FOUR, EXTENTS, EXTENTS)
def test_swapping_the_two_swaps_the_answer(points, first, second):
    p, u, q, v = np.array(points, float)
    forward, back = closest_points(p, u, q, v, first, second), closest_points(q, v, p, u, second, first)
    assert abs(forward.distance - back.distance) <= 1e-14


@settings(max_examples=25)
@given(st.integers(0, 2**32 - 1))
def test_a_common_rigid_motion_moves_the_points(seed):
    rng = np.random.default_rng(seed)
    p, u, q, v, shift = rng.normal(size=(5, 3))
    turn = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    found, moved = closest_points(p, u, q, v), closest_points(turn @ p + shift, turn @ u, turn @ q + shift, turn @ v)
    assert abs(found.distance - moved.distance) < 1e-13
    assert np.abs(turn @ found.point_a + shift - moved.point_a).max() < 1e-11


@pytest.mark.parametrize(
    ("q", "v", "alpha", "beta"),
    [
        ((0.5, 1, 0), (1, 0, 0), 0.75, 0.25),  # side by side from 0.5 to 1
        ((0.75, 1, 0), (-0.5, 0, 0), 0.5, 0.5),  # antiparallel, B alongside A
        ((3, 4, 0), (1, 0, 0), 1, 0),  # past the end
        ((1, 0, 0), (1, 0, 0), 1, 0),  # touching in line
        ((0.25, 0, 0), (0.5, 0, 0), 0.5, 0.5),  # B inside A
    ],
)
def test_parallel_segments_answer_with_the_middle(q, v, alpha, beta):
    found = closest_points([0, 0, 0], [1, 0, 0], q, v)
    assert (found.alpha, found.beta) == (alpha, beta)


def test_parallel_lines_and_rays():
    lines = closest_points([0, 0, 0], [1, 0, 0], [10, 3, 0], [2, 0, 0], LINE, LINE)
    least_norm = np.linalg.lstsq(np.array([[1.0, -2.0]]), np.array([10.0]), rcond=None)[0]
    assert np.allclose([lines.alpha, lines.beta], least_norm) and lines.distance == 3
    towards = closest_points([0, 0, 0], [1, 0, 0], [10, 3, 0], [-2, 0, 0], RAY, RAY)
    assert (towards.alpha, towards.beta, towards.distance) == (5, 2.5, 3)
    away = closest_points([0, 0, 0], [-1, 0, 0], [4, 3, 0], [1, 0, 0], RAY, RAY)
    assert (away.alpha, away.beta, away.distance) == (0, 0, 5)
    chasing = closest_points([0, 0, 0], [1, 0, 0], [4, 3, 0], [1, 0, 0], RAY, RAY)
    assert (chasing.alpha, chasing.beta, chasing.distance) == (4, 0, 3)


@pytest.mark.parametrize("angle", [10.0**-k for k in range(1, 17)])
def test_nearly_parallel_segments(angle):
    v = np.array([np.cos(angle), np.sin(angle), 0])
    found = closest_points([-1, 0, 0], [2, 0, 0], -v + [0, 0, 0.5], 2 * v)
    assert abs(found.distance - 0.5) < 1e-12


def test_points_instead_of_segments():
    both = closest_points([1, 2, 3], [0, 0, 0], [1, 2, 5], [0, 0, 0])
    assert both.distance == 2
    one = closest_points([0.25, 1, 0], [0, 0, 0], [0, 0, 0], [1, 0, 0])
    assert (one.beta, one.distance) == (0.25, 1)
    assert closest_points(np.zeros((4, 1, 3)), np.ones(3), np.ones((5, 3)), np.ones(3)).distance.shape == (4, 5)
    with pytest.raises(InputError, match="finite"):
        closest_points([0, 0, np.nan], [0, 0, 0], [0, 0, 0], [0, 0, 0])
    with pytest.raises(InputError, match="broadcast"):
        closest_points(np.zeros((4, 3)), np.ones(3), np.ones((5, 3)), np.ones(3))
