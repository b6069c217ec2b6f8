"""Vertex-face and edge-edge impacts: no contact that is exact in rationals is missed, and no miss is a hit."""

from __future__ import annotations

from fractions import Fraction
from math import inf

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import collision_monitor as cm
from collision_monitor import edge_edge_impact, vertex_face_impact

SOLVERS = {"face": vertex_face_impact, "edges": edge_edge_impact}

VERTEX = [[0, 0, 1], [-1, -1, 0], [1, -1, 0], [0, 1, 0], [0, 0, -1], [-1, -1, 0], [1, -1, 0], [0, 1, 0]]
EDGES = [[-1, 0, 1], [1, 0, 1], [0, -1, 0], [0, 1, 0], [-1, 0, -1], [1, 0, -1], [0, -1, 0], [0, 1, 0]]


def combination(kind, u, w):
    """Weights of the four points in F(t, u, w)."""
    return (1, u + w - 1, -u, -w) if kind == "face" else (1 - u, u, w - 1, -w)


def meets_exactly(kind, x, t, u, w):
    """Whether F(t, u, w) is 0, in rationals."""
    points = [[Fraction(float(c)) for c in p] for p in x]
    moved = [[(1 - t) * a + t * b for a, b in zip(points[k], points[k + 4], strict=True)] for k in range(4)]
    weights = combination(kind, u, w)
    return all(sum(c * p[k] for c, p in zip(weights, moved, strict=True)) == 0 for k in range(3))


def first_roots(kind, x, ends=1e-9):
    """Times at which the features meet, from the roots of the cubic at which the four points are coplanar."""
    start, end = x[:4], x[4:]

    def volume(t):
        p = start + t * (end - start)
        return np.linalg.det([p[1] - p[0], p[2] - p[0], p[3] - p[0]])

    ts = np.array([0.0, 1 / 3, 2 / 3, 1.0])
    cubic = np.polyfit(ts, [volume(t) for t in ts], 3)
    found = []
    for root in np.roots(cubic):
        if abs(root.imag) > 1e-9 or not -ends <= root.real <= 1 + ends:
            continue
        p = start + root.real * (end - start)
        a, b, c = (p[0] - p[1], p[1] - p[2], p[1] - p[3]) if kind == "face" else (p[0] - p[2], p[1] - p[0], p[2] - p[3])
        (u, w), *_ = np.linalg.lstsq(np.column_stack([b, c]), -a, rcond=None)
        inside = min(u, w) >= -ends and ((u + w <= 1 + ends) if kind == "face" else max(u, w) <= 1 + ends)
        if inside:
            found.append(float(root.real))
    return sorted(found)


@pytest.mark.parametrize("kind", SOLVERS)
@settings(max_examples=300, deadline=None)
@given(st.data())
def test_no_exact_contact_is_missed(kind, data):
    """Small integers with an exact contact at a dyadic (t, u, w), scaled and moved without rounding."""
    eighth = st.integers(0, 8).map(lambda k: Fraction(k, 8))
    t, u = data.draw(eighth), data.draw(eighth)
    w = data.draw(eighth)
    if kind == "face" and u + w > 1:
        u, w = 1 - u, 1 - w
    corner = st.lists(st.integers(-64, 64), min_size=3, max_size=3)
    points = [[Fraction(c) for c in data.draw(corner)] for _ in range(8)]
    # place the first point with a weight, at an end with a share, so that F = 0
    weights = combination(kind, u, w)
    k = next(i for i, c in enumerate(weights) if c)
    end = 1 if t > 0 else 0
    share = weights[k] * (t if end else 1 - t)
    for axis in range(3):
        moved = [(1 - t) * points[i][axis] + t * points[i + 4][axis] for i in range(4)]
        rest = sum(c * p for c, p in zip(weights, moved, strict=True)) - share * points[k + 4 * end][axis]
        points[k + 4 * end][axis] = -rest / share
    exponent = data.draw(st.sampled_from([-30, 0, 30]))
    x = np.array([[float(c * Fraction(2) ** exponent) for c in p] for p in points])
    if data.draw(st.booleans()):
        x += 2.0**30  # far from the origin; rounding gives another query, which is checked exactly below
    if not meets_exactly(kind, x, t, u, w):
        return  # the division by an odd share was rounded
    answer = SOLVERS[kind](x)
    assert answer.status != "clear"
    assert answer.lower <= t
    if answer.status == "hit":
        assert answer.upper >= answer.lower


@pytest.mark.parametrize("kind", SOLVERS)
def test_random_queries_against_the_roots_of_the_cubic(kind):
    rng = np.random.default_rng(2)
    x = rng.normal(size=(3000, 8, 3))
    answer = SOLVERS[kind](x)
    assert (answer.status != "unresolved").mean() > 0.999
    hits = 0
    for k in range(len(x)):
        roots = first_roots(kind, x[k])
        if roots:
            hits += 1
            assert answer.status[k] != "clear"
            assert answer.lower[k] <= roots[0] + 1e-9
            if answer.status[k] == "hit" and first_roots(kind, x[k], -1e-3)[:1] == roots[:1]:
                assert roots[0] <= answer.upper[k] + 1e-5
        elif answer.status[k] == "hit":
            # within the tolerance of a contact or of the features' borders
            assert first_roots(kind, x[k], 1e-3)
    assert 100 < hits < 1500


@pytest.mark.parametrize("kind", SOLVERS)
def test_separation_counts_as_contact(kind):
    x = np.array(VERTEX if kind == "face" else EDGES, float)
    answer = SOLVERS[kind](x, separation=0.25)
    assert answer.lower <= 0.375 <= answer.upper + 1e-6
    assert answer.upper - answer.lower < 1e-5
    x[:, 2] += np.where(np.arange(8) % 4 < (1 if kind == "face" else 2), 1.1, 0.0)  # ends 0.1 above
    assert SOLVERS[kind](x).status == "clear"
    assert SOLVERS[kind](x, separation=0.099).status == "clear"
    assert SOLVERS[kind](x, separation=0.101).status == "hit"


COPLANAR = [[-2, 0.1, 0], [-1, 0, 0], [1, 0, 0], [0, 1, 0], [2, 0.1, 0], [-1, 0, 0], [1, 0, 0], [0, 1, 0]]
PARALLEL = [[-1, 0, 1], [1, 0, 1], [-1, 0, 0], [1, 0, 0], [-1, 0, -1], [1, 0, -1], [-1, 0, 0], [1, 0, 0]]
COLLINEAR = [[-5, 0, 0], [-4, 0, 0], [0, 0, 0], [1, 0, 0], [3, 0, 0], [4, 0, 0], [0, 0, 0], [1, 0, 0]]
POINTS = [[0, 0, 1], [0, 0, 1], [0, 0, 0], [0, 0, 0], [0, 0, -1], [0, 0, -1], [0, 0, 0], [0, 0, 0]]
GRAZING = [[-1, 0, 0], [0, -1, 0], [0, 1, 0], [0, 0, -1], [1, 0, 0], [0, -1, 0], [0, 1, 0], [0, 0, -1]]
DOT = [[0, 0, 1], [0, 0, 0], [0, 0, 0], [0, 0, 0], [0, 0, -1], [0, 0, 0], [0, 0, 0], [0, 0, 0]]


@pytest.mark.parametrize("turn", [False, True])
@pytest.mark.parametrize("scale", [2.0**-30, 1.0, 2.0**30])
@pytest.mark.parametrize(
    ("kind", "x", "t"),
    [
        ("face", COPLANAR, 0.275),
        ("edges", PARALLEL, 0.5),
        ("edges", COLLINEAR, 0.5),
        ("edges", POINTS, 0.5),
        ("face", GRAZING, 0.5),
        ("face", DOT, 0.5),
    ],
    ids=["coplanar", "parallel", "collinear", "zero length", "grazing", "a face that is a point"],
)
def test_degenerate_features_are_found_within_the_budget(kind, x, t, scale, turn):
    x = np.array(x) * scale
    if turn:
        x = x @ np.linalg.qr(np.random.default_rng(4).normal(size=(3, 3)))[0].T
    answer = SOLVERS[kind](x)
    assert answer.status == "hit"
    assert answer.lower <= t + 1e-12
    assert t <= answer.upper + 1e-6  # within the tolerance the impact may be earlier
    assert answer.upper - answer.lower < 1e-5


@pytest.mark.parametrize("gap", [0.0, 1e-12, 1e-6, 0.5])
def test_edges_that_are_nearly_parallel_come_as_near_as_they_do(gap):
    """The edges cross in the middle, `gap` apart; their ends are farther by less than many formulas' round-off."""
    rng = np.random.default_rng(6)
    for angle in np.geomspace(1e-12, 1e-2, 60):
        along, across = np.array([1.0, 0, 0]), np.array([np.cos(angle), np.sin(angle), 0])
        over = np.array([0, 0, gap])
        x = np.array([-along, along, over - across, over + across]) * rng.uniform(0.1, 1)
        reached = x[2, 2]
        x = np.concatenate([x, x])
        assert edge_edge_impact(x, separation=reached + 1e-9, tolerance=1e-12).status != "clear"
        if gap > 1e-6:
            assert edge_edge_impact(x, separation=reached - 2e-9, tolerance=1e-12).status == "clear"


def test_a_small_budget_is_unresolved_and_its_lower_bound_holds():
    x = np.array(VERTEX, float)
    for budget in range(1, 120):
        answer = vertex_face_impact(x, budget=budget)
        assert answer.status != "clear"
        assert answer.lower <= 0.5 <= answer.upper
    assert vertex_face_impact(x, budget=1).status == "unresolved"
    assert vertex_face_impact(x, budget=1).upper == inf


def test_shapes_of_queries():
    x = np.broadcast_to(np.array(VERTEX, float), (2, 5, 8, 3))
    answer = vertex_face_impact(x)
    assert answer.status.shape == answer.lower.shape == answer.upper.shape == (2, 5)
    assert (answer.status == "hit").all()
    assert answer.status.dtype.kind == "U"
    one = vertex_face_impact(VERTEX)
    assert isinstance(one.status, str) and isinstance(one.lower, float)
    assert vertex_face_impact(np.zeros((0, 8, 3))).status.shape == (0,)
    still = vertex_face_impact([*VERTEX[:4], *VERTEX[:4]])
    assert (still.status, still.lower) == ("clear", inf)
    assert vertex_face_impact(np.zeros((8, 3))).lower == 0.0  # all points coincide: they touch from the start


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ({"x": np.zeros((8, 2))}, r"\(\.\.\., 8, 3\), got shape \(8, 2\)"),
        ({"x": np.zeros(3)}, "got shape"),
        ({"x": "corner"}, "expected numbers"),
        ({"x": np.full((8, 3), np.nan)}, "finite coordinates"),
        ({"x": np.zeros((8, 3)), "separation": -1.0}, "separation"),
        ({"x": np.zeros((8, 3)), "tolerance": 0.0}, "tolerance"),
        ({"x": np.zeros((8, 3)), "budget": 0}, "budget"),
        ({"x": np.zeros((8, 3)), "budget": 1e3}, "budget: expected a whole number from 1, got 1000.0"),
        ({"x": np.zeros((8, 3)), "separation": "near"}, "separation: expected a finite number, at least 0, got 'near'"),
    ],
)
def test_what_is_refused(arguments, words):
    for solver in SOLVERS.values():
        with pytest.raises(cm.InputError, match=words):
            solver(**arguments)
