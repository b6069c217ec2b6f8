"""The classical methods against each other: cases in which a method is exact, and errors of the others."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_allclose

import collision_monitor as cm
from collision_monitor.query.impact.impact_methods import METHODS, STEP, bisection, closed_form, end_of_step, swept_sat

A, B = cm.Box((0.7, 0.9, 0.5)), cm.Box((1.2, 0.3, 0.8))
HORIZON = 2.0


def states(rng, n, turning=True):
    q = rng.normal(size=(n, 4))
    q /= np.linalg.norm(q, axis=1, keepdims=True)
    return np.column_stack([rng.uniform(-2, 2, (n, 3)), q, rng.normal(size=(n, 3)), turning * rng.normal(size=(n, 3))])


def test_swept_sat_is_exact_for_boxes_that_do_not_turn():
    rng = np.random.default_rng(0)
    a, b = states(rng, 2000, False), states(rng, 2000, False)
    b[:50, 3:7] = a[:50, 3:7]  # parallel edges
    swept, advanced = swept_sat(A, a, B, b, HORIZON), METHODS["conservative_advancement"](A, a, B, b, HORIZON)
    met = np.isfinite(swept)
    assert met.sum() > 150 and (advanced <= swept).all()
    gap = (swept[met] - advanced[met]) * np.linalg.norm(b[:, 7:10] - a[:, 7:10], axis=1)[met]
    assert np.median(gap) < 2e-6
    halved = bisection(A, a, B, b, HORIZON)
    both = met & np.isfinite(halved)
    assert_allclose(swept[both], halved[both], atol=1e-9)
    assert not (np.isfinite(halved) & ~met).any()


def test_only_bounds_and_advancement_are_never_late():
    rng = np.random.default_rng(1)
    a, b = states(rng, 1000), states(rng, 1000)
    fine = bisection(A, a, B, b, HORIZON, 1e-3)
    advanced = METHODS["conservative_advancement"](A, a, B, b, HORIZON)
    assert (METHODS["swept_bounds"](A, a, B, b, HORIZON) <= advanced).all()
    assert (advanced <= fine).all()
    ended = end_of_step(A, a, B, b, HORIZON)
    both = np.isfinite(fine) & np.isfinite(ended)
    late = ended[both] - fine[both]
    assert (late > -1e-9).all() and (late <= STEP).mean() > 0.9 and late.max() > 0.5 * STEP


def test_closed_forms_are_exact():
    rng = np.random.default_rng(2)
    a, b = states(rng, 500), states(rng, 500)
    ball, small = cm.Sphere(0.5), cm.Sphere(0.2)
    exact, halved = closed_form(ball, a, small, b, HORIZON), bisection(ball, a, small, b, HORIZON, 1e-3)
    both = np.isfinite(halved)
    assert both.sum() > 15
    assert_allclose(exact[both], halved[both], atol=1e-8)
    b[:, 10:] = 0.0
    floor = cm.HalfSpace((0, 0, 1), -1)
    assert_allclose(closed_form(ball, a, floor, b, HORIZON), bisection(ball, a, floor, b, HORIZON), atol=1e-9)


def test_end_of_step_misses_what_passes_within_a_step():
    plate, bullet = cm.Box((1, 1, 1e-3)), cm.Sphere(5e-4)
    rest, fast = np.zeros((1, 13)), np.zeros((1, 13))
    rest[0, 6] = fast[0, 6] = 1.0
    fast[0, [2, 9]] = 505.3, -1000.0
    assert end_of_step(plate, rest, bullet, fast, HORIZON) == np.inf
    assert METHODS["conservative_advancement"](plate, rest, bullet, fast, HORIZON) == pytest.approx(0.505299, rel=1e-9)


def test_what_a_method_does_not_answer_it_refuses():
    state = np.zeros((1, 13))
    state[0, 6] = 1.0
    with pytest.raises(cm.UnsupportedError, match="swept_sat: supported is Box with Box"):
        swept_sat(A, state, cm.Sphere(1), state, HORIZON)
    with pytest.raises(cm.UnsupportedError, match="closed_form: supported are"):
        closed_form(A, state, B, state, HORIZON)
