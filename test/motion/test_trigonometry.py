"""Sine and cosine against their series, summed in exact rationals."""

from __future__ import annotations

import math
from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from collision_monitor._jit import kernel
from collision_monitor.motion.trigonometry import sin_cos

PI = Fraction(314159265358979323846264338327950288419716939937510582097494459230781640628620899, 10**80)


@kernel
def both(x):
    return sin_cos(x)


def exact(x: float) -> tuple[Fraction, Fraction]:
    """Sine and cosine by Taylor's series after an exact reduction; the remainder is below 1e-40."""
    r = Fraction(x) % (2 * PI)
    r -= 2 * PI if r > PI else 0
    terms, term = [], Fraction(1)
    for n in range(1, 60):
        terms.append(term)
        term = (term * r / n).limit_denominator(10**60)
    sine = sum(t * (-1) ** (n // 2) for n, t in enumerate(terms) if n % 2)
    cosine = sum(t * (-1) ** (n // 2) for n, t in enumerate(terms) if not n % 2)
    return Fraction(sine), Fraction(cosine)


@given(st.floats(-1e6, 1e6))
def test_within_two_units_in_the_last_place_of_one(x: float) -> None:
    for mine, true in zip(both(x), exact(x), strict=True):
        assert abs(Fraction(mine) - true) <= 4.5e-16


@given(st.floats(-1e-3, 1e-3))
def test_small_angles_keep_their_relative_accuracy(x: float) -> None:
    s, c = both(x)
    assert s == pytest.approx(math.sin(x), rel=3e-16, abs=0) and c == pytest.approx(math.cos(x), rel=3e-16)


def test_symmetry_and_the_far_end() -> None:
    x = np.concatenate([np.linspace(-20, 20, 4001), np.pi / 4 * np.arange(-9, 10), [1e7, 1e300]])
    for value in x.tolist():
        s, c = both(value)
        assert (-s, c) == both(-value)
        assert abs(s * s + c * c - 1.0) < 1e-15
    assert np.isnan(both(np.inf)).all()
