"""Tests of signs against rational numbers, on lattices where most determinants vanish, and one bit beside them."""

from fractions import Fraction
from math import ldexp

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from rational import EXPONENTS, POINTS_2D, POINTS_3D, area2, sign, volume6

from collision_monitor.errors import InputError
from collision_monitor.geometry.orientation import LARGEST, SMALLEST, orient2d, orient3d, segments_cross

NUDGES = st.lists(st.integers(-2, 2), min_size=12, max_size=12)


def nudged(points, nudges, exponent):
    """Lattice points divided by 3 (not representable), scaled, with each coordinate moved by a few last bits."""
    x = np.array(points, float) / 3 * 2.0**exponent
    bits = np.array(nudges[: x.size]).reshape(x.shape)
    return x + bits * np.spacing(np.where(x == 0, 2.0**exponent, np.abs(x)))


@given(st.tuples(POINTS_2D, POINTS_2D, POINTS_2D), NUDGES, EXPONENTS)
def test_orient2d_has_the_exact_sign_and_a_close_value(points, nudges, exponent):
    a, b, p = nudged(points, nudges, exponent)
    value, true = float(orient2d(a, b, p)), area2(a, b, p)
    assert np.sign(value) == sign(true)
    assert abs(Fraction(value) - true) <= Fraction(1, 10**12) * abs(true)


@given(st.tuples(POINTS_3D, POINTS_3D, POINTS_3D, POINTS_3D), NUDGES, EXPONENTS)
def test_orient3d_has_the_exact_sign_and_a_close_value(points, nudges, exponent):
    a, b, c, p = nudged(points, nudges, exponent)
    value, true = float(orient3d(a, b, c, p)), volume6(a, b, c, p)
    assert np.sign(value) == sign(true)
    assert abs(Fraction(value) - true) <= Fraction(1, 10**12) * abs(true)


FLOATS = st.builds(
    lambda sign, digits, exponent: sign * ldexp(digits, exponent),
    st.sampled_from((-1.0, 0.0, 1.0)),
    st.integers(1, 2**53 - 1),
    st.one_of(st.integers(-1074, 970), st.integers(-1074, -1000), st.integers(900, 970), st.integers(-380, -330)),
)
"""Any float64 from 5e-324 to 1.7e308; more often than not near an end, or with products that underflow."""

FEW = st.lists(FLOATS, min_size=1, max_size=4)
"""Coordinates are drawn from few numbers, so that differences vanish and terms cancel."""


def _assert_same(value, true):
    """The sign is exact, and so are 12 digits of what a float can hold."""
    assert np.sign(value) == sign(true) and np.isfinite(value)
    if Fraction(1e-300) < abs(true) < Fraction(1.7e308):
        assert abs(Fraction(value) - true) <= Fraction(1, 10**12) * abs(true)


@settings(max_examples=400)
@given(FEW, st.data())
def test_every_float_has_the_exact_sign(numbers, data):
    pick = st.sampled_from(numbers)
    a, b, p = (data.draw(st.tuples(pick, pick)) for _ in range(3))
    _assert_same(float(orient2d(a, b, p)), area2(a, b, p))
    a, b, c, p = (data.draw(st.tuples(pick, pick, pick)) for _ in range(4))
    _assert_same(float(orient3d(a, b, c, p)), volume6(a, b, c, p))


def test_an_integer_that_no_float_holds_keeps_its_sign():
    points = [1e308] * 3, [5e-324, 0, 0], [0, 1e308, 0], [0, 0, -1e308]
    assert orient3d(*points) == LARGEST and volume6(*points) > 0
    assert orient3d(points[1], points[0], *points[2:]) == -LARGEST
    assert orient2d([0, 0], [1e308, 5e-324], [0, -1e308]) == -LARGEST
    assert orient3d([0, 0, 0], [5e-324, 0, 0], [0, 5e-324, 0], [0, 0, -5e-324]) == -SMALLEST


def test_a_lost_product_is_not_enlarged_to_a_certain_one():
    # u0 v1 underflows to 0 although w2 makes it the largest term
    a, b, c, p = (0, 0, 0), (1e-163, 0, 1.0), (0, 1e-163, 0), (-1e-37, 0, -1e150)
    assert np.sign(orient3d(a, b, c, p)) == sign(volume6(a, b, c, p)) == -1


def test_a_column_of_zeros_is_zero_where_the_others_overflow():
    assert orient3d([1, -1e308, 0], [1, 1e308, -1e308], [1, 0, 1e308], [1, 1e308, 1e308]) == 0.0
    assert segments_cross([0, -1e308], [0, 1e308], [0, 1e308], [0, -1e308]) == 0.0


@given(st.tuples(POINTS_2D, POINTS_2D, POINTS_2D), NUDGES)
def test_swapping_two_points_turns_the_sign(points, nudges):
    a, b, p = nudged(points, nudges, 0)
    assert np.sign(orient2d(a, b, p)) == -np.sign(orient2d(b, a, p)) == np.sign(orient2d(b, p, a))


def test_a_mistake_of_plain_floating_point_is_not_made():
    a, b = np.array([12.0, 12.0]), np.array([24.0, 24.0])
    steps = np.arange(64) * 2.0**-53
    p = np.stack(np.meshgrid(0.5 + steps, 0.5 + steps), axis=-1)
    u, w = b - a, p - a
    naive = np.sign(u[0] * w[..., 1] - u[1] * w[..., 0])
    right = np.sign(p[..., 1] - p[..., 0])  # above the diagonal
    assert (naive != right).any()
    assert (np.sign(orient2d(a, b, p)) == right).all()


@pytest.mark.parametrize("scale", [1e-320, 1e-200, 1e150, 1e300])
def test_underflow_and_overflow_keep_the_sign(scale):
    assert orient2d([0, 0], [scale, 0], [0, scale]) > 0
    assert orient2d([0, 0], [0, scale], [scale, 0]) < 0
    assert orient3d([0, 0, 0], [scale, 0, 0], [0, scale, 0], [0, 0, scale]) > 0
    assert orient3d([0, 0, 0], [scale, 0, 0], [0, scale, 0], [0, 0, -scale]) < 0


def test_parallel_vectors_of_different_points():
    assert segments_cross([0, 0], [0.1, 0.3], [5, 5], [5.125, 5.375]) != 0  # 0.1 is not exactly representable
    assert segments_cross([0, 0], [1, 3], [5, 5], [5.125, 5.375]) == 0


def test_arrays_broadcast():
    rng = np.random.default_rng(1)
    a, b, p = rng.normal(size=(4, 1, 2)), rng.normal(size=(4, 1, 2)), rng.normal(size=(7, 2))
    value = orient2d(a, b, p)
    assert value.shape == (4, 7)
    assert value[2, 5] == orient2d(a[2, 0], b[2, 0], p[5])


@pytest.mark.parametrize("bad", [[np.nan, 0], [np.inf, 0], [0, 0, 0], [[0, 0]] * 3])
def test_bad_points_are_refused(bad):
    with pytest.raises(InputError, match="expected"):
        orient2d([0, 0], [[1, 0], [2, 0]], bad)
