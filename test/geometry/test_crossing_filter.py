"""Tests that the filter of crossings decides nothing that rational numbers decide otherwise."""

from fractions import Fraction

import numpy as np
import pytest
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st
from rational import EXPONENTS, POINTS_3D

from collision_monitor.geometry.crossing_filter import MISSED, UNDECIDED, tabulate_crossings


def tabulate(points, a, b, c):
    table = np.full((len(points), len(a)), 99, np.int8)
    tabulate_crossings(*(np.ascontiguousarray(x, float) for x in (points, a, b, c)), table)
    return table


def exactly(p, a, b, c):
    """1 or -1 if the ray from p to +z meets the inner part of a face above p, 0 if not, None on an edge or the face."""
    p, a, b, c = ([Fraction(x) for x in point] for point in (p, a, b, c))
    turns = [(v[0] - u[0]) * (p[1] - u[1]) - (v[1] - u[1]) * (p[0] - u[0]) for u, v in ((a, b), (b, c), (c, a))]
    if min(turns) < 0 < max(turns):
        return 0
    if 0 in turns:
        return None
    z = (turns[1] * a[2] + turns[2] * b[2] + turns[0] * c[2]) / sum(turns)  # of the face, above p
    if z == p[2]:
        return None
    return 0 if z < p[2] else 1 if turns[0] > 0 else -1


@settings(max_examples=300)
@given(st.lists(POINTS_3D, min_size=4, max_size=4), EXPONENTS)
def test_what_it_decides_is_exact(points, exponent):
    p, a, b, c = np.array(points, float) * 2.0**exponent
    found = tabulate([p], [a], [b], [c])[0, 0]
    if found != UNDECIDED:
        expected = exactly(p, a, b, c)
        assert found == (expected or MISSED)
        if expected is None:  # the ray touches an edge: only what is beside or below the box of the face is missed
            beside = [not min(u) <= x <= max(u) for x, u in zip(p[:2], np.array([a, b, c]).T, strict=False)]
            assert any(beside) or p[2] > max(a[2], b[2], c[2])


@pytest.mark.parametrize("scale", [1e-180, 1.0, 1e180])
@pytest.mark.parametrize("seed", range(4))
def test_points_beside_edges_by_a_few_ulps(seed, scale):
    rng = np.random.default_rng(seed)
    a, b, c = rng.normal(size=(3, 50, 3))
    on_edge = a + rng.random((50, 1)) * (b - a) - [0, 0, 0.1]
    points = on_edge + rng.integers(-3, 4, (50, 3)) * 2.0**-52
    a, b, c, points = (scale * x for x in (a, b, c, points))
    found = np.diag(tabulate(points, a, b, c))
    wrong = [k for k in range(50) if found[k] != UNDECIDED and found[k] != exactly(points[k], a[k], b[k], c[k])]
    assert not wrong


def test_few_points_of_a_curved_mesh_are_left():
    torus = trimesh.creation.torus(2.0, 0.5, major_sections=24, minor_sections=12)
    points = np.random.default_rng(0).uniform(-3, 3, (500, 3)) * [1, 1, 0.25]
    table = tabulate(points, *(torus.vertices[torus.faces[:, k]] for k in range(3)))
    met = np.isin(table, [1, -1])
    assert met.sum() > 100
    assert (table == UNDECIDED).sum() < 0.1 * met.sum()
