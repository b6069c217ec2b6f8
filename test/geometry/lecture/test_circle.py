"""The circle by its equations, against rational arithmetic and against each other."""

from __future__ import annotations

from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from collision_monitor.errors import InputError
from collision_monitor.geometry.lecture.circle import implicit_circle, parametric_circle

NUMBERS = st.floats(-1e150, 1e150)
NEAR = st.integers(-50, 50).map(lambda k: k / 8)


def exactly(p, c, r) -> Fraction:
    return sum((Fraction(x) - Fraction(y)) ** 2 for x, y in zip(p, c, strict=True)) - Fraction(r) ** 2


@given(st.tuples(NEAR, NEAR), st.tuples(NEAR, NEAR), st.integers(0, 200).map(lambda k: k / 16), st.integers(-400, 400))
def test_the_sign_is_exact_near_the_boundary(p, c, r, exponent) -> None:
    p, c, r = np.array(p) * 2.0**exponent, np.array(c) * 2.0**exponent, r * 2.0**exponent
    for point in (p, np.nextafter(p, np.inf), np.nextafter(p, -np.inf)):
        expected = exactly(point.tolist(), c.tolist(), r)
        assert np.sign(implicit_circle(point, c, r)) == (expected > 0) - (expected < 0)


@given(st.tuples(NUMBERS, NUMBERS, NUMBERS), st.tuples(NUMBERS, NUMBERS, NUMBERS), st.floats(0, 1e150))
def test_a_sphere_of_any_size(p, c, r) -> None:
    expected = exactly(p, c, r)
    found = float(implicit_circle(p, c, r))
    assert np.sign(found) == (expected > 0) - (expected < 0)
    assert found == pytest.approx(float(expected), rel=1e-12)


def test_the_circle_of_the_slide() -> None:
    """x² + y² - 1: positive outside, 0 on the boundary, negative inside."""
    values = implicit_circle([[2, 0], [1, 0], [0.6, 0.8], [0.5, 0.5], [0, 0]], (0, 0), 1.0)
    assert values[0] == 3 and values[1] == 0 and values[3] == -0.5 and values[4] == -1
    assert abs(values[2]) < 1e-15  # 0.6 and 0.8 are no binary fractions
    assert implicit_circle((3, 4), (0, 0), 5) == 0 and implicit_circle((2, 3, 6), (0, 0, 0), 7) == 0


def test_generated_points_are_on_the_circle_and_go_round_once() -> None:
    angle = np.linspace(0, 2 * np.pi, 100, endpoint=False)
    points = parametric_circle((1, -2), 3.0, angle)
    assert points.shape == (100, 2)
    assert np.abs(implicit_circle(points, (1, -2), 3.0)).max() < 1e-14 * 9
    x, y = points.T
    area = 0.5 * np.sum(x * np.roll(y, -1) - y * np.roll(x, -1))
    assert area == pytest.approx(np.pi * 9, rel=1e-3) and area > 0.0  # counter-clockwise
    assert parametric_circle((0, 0), 1.0, 0.0).tolist() == [1, 0]
    several = parametric_circle([[0, 0], [5, 5]], [1.0, 2.0], [0.0, np.pi / 2])
    np.testing.assert_allclose(several, [[1, 0], [5, 7]], atol=1e-15)


def test_what_is_no_circle_is_refused() -> None:
    for wrong in (
        ((0, 0), (0, 0), -1.0),
        ((0, 0), (0, 0, 0), 1.0),
        ((np.nan, 0), (0, 0), 1.0),
        ((0, 0), (0, 0), np.inf),
    ):
        with pytest.raises(InputError):
            implicit_circle(*wrong)
    with pytest.raises(InputError):
        parametric_circle((0, 0, 0), 1.0, 0.0)
    with pytest.raises(InputError, match="broadcast"):
        parametric_circle(np.zeros((3, 2)), 1.0, np.zeros(2))
