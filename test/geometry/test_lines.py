"""Tests of lines, rays and segments in the plane against rational numbers."""

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from rational import EXPONENTS, POINTS_2D, area2, common_points, cross2, exact, minus

from collision_monitor.errors import InputError
from collision_monitor.geometry.lines import (
    LineKind,
    Relation,
    explicit_line,
    implicit_line,
    intersect,
    point_at,
    segments_intersect,
    side,
)

FOUR = st.tuples(POINTS_2D, POINTS_2D, POINTS_2D, POINTS_2D)


def test_the_slides_forms_of_a_line():
    assert point_at([0, 0], [1, 1], [0.5, -1, 2]).tolist() == [[0.5, 0.5], [-1, -1], [2, 2]]
    slope, intercept = explicit_line([0, 5], [1, 7])
    assert (slope, intercept) == (2, 5)  # y = 2 x + 5
    a, b, c = implicit_line([0, 5], [1, 7])
    assert a * 3 + b * 11 + c == 0
    assert a * 0 + b * 9 + c > 0  # left of the line
    assert side([[3, 1], [3, 0], [3, -1]], [0, 0], [5, 0]).tolist() == [1, 0, -1]


def test_lines_that_have_no_such_form_are_refused():
    with pytest.raises(InputError, match="vertical"):
        explicit_line([1, 0], [1, 5])
    with pytest.raises(InputError, match="different points"):
        implicit_line([1, 2], [1, 2])
    with pytest.raises(InputError, match="different points"):
        intersect([1, 2], [1, 2], [0, 0], [1, 0], LineKind.RAY)
    with pytest.raises(InputError, match="finite"):
        intersect([1, np.nan], [1, 2], [0, 0], [1, 0])


@given(FOUR, EXPONENTS)
def test_segments_against_rational_numbers(points, exponent):
    a, b, c, d = np.array(points) * 2.0**exponent
    found, true = intersect(a, b, c, d), common_points(a, b, c, d)
    if true is None:
        assert found.relation == Relation.NONE
    elif true[0] != true[1]:
        assert found.relation == Relation.OVERLAP
    else:
        assert found.relation == Relation.POINT
        point = np.array([float(x) for x in true[0]])
        assert np.abs(found.point - point).max() <= 1e-15 * 8 * 2.0**exponent
        assert np.abs(a + found.t_a * (b - a) - point).max() <= 4e-15 * 8 * 2.0**exponent
        assert np.abs(c + found.t_b * (d - c) - point).max() <= 4e-15 * 8 * 2.0**exponent
    assert np.isnan(found.point).all() == (found.relation != Relation.POINT)


@given(FOUR)
def test_swapped_and_reversed_segments_meet_alike(points):
    a, b, c, d = np.array(points, float)
    relation = intersect(a, b, c, d).relation
    assert relation == intersect(c, d, a, b).relation == intersect(b, a, d, c).relation
    turned = [[-y, x] for x, y in points]
    assert relation == intersect(*turned).relation


@given(FOUR, st.sampled_from(list(LineKind)), st.sampled_from(list(LineKind)))
def test_every_pair_of_extents_by_solving_the_slides_equations(points, first, second):
    a, b, c, d = points
    assume(a != b and c != d)
    found = intersect(a, b, c, d, first, second)
    u, v, w = minus(exact(b), exact(a)), minus(exact(d), exact(c)), minus(exact(c), exact(a))
    turn = cross2(u, v)
    if turn:
        t_a, t_b = cross2(w, v) / turn, cross2(w, u) / turn
        meets = first.value[0] <= t_a <= first.value[1] and second.value[0] <= t_b <= second.value[1]
        assert (found.relation == Relation.POINT) == meets
        if meets:
            assert abs(found.t_a - float(t_a)) <= 1e-13 * max(1, abs(t_a))
            assert abs(found.t_b - float(t_b)) <= 1e-13 * max(1, abs(t_b))
    elif area2(a, b, c):
        assert found.relation == Relation.NONE
    else:
        # long enough to act as infinite among these points
        def cut(p, q, extent):
            p, q = np.array(p), np.array(q)
            least, greatest = np.clip(extent.value, -100, 100)
            return p + least * (q - p), p + greatest * (q - p)

        true = common_points(*cut(a, b, first), *cut(c, d, second))
        expected = Relation.NONE if true is None else Relation.POINT if true[0] == true[1] else Relation.OVERLAP
        assert found.relation == expected


def test_nearly_parallel_segments_cross_where_they_do():
    tiny = np.ldexp(1.0, -50)
    found = intersect([-1, -tiny], [1, tiny], [-1, tiny], [1, -tiny])
    assert found.relation == Relation.POINT
    assert np.abs(found.point).max() < 1e-15
    below = intersect([-1, 0], [1, 0], [-1, tiny], [1, np.ldexp(1.0, -1070)])
    assert below.relation == Relation.NONE  # apart by a tiny distance


def test_touching_at_a_corner_returns_it_to_the_last_bit():
    rng = np.random.default_rng(3)
    a, b, c = rng.normal(size=(3, 200, 2))
    found = intersect(a, b, b, c)
    assert (found.relation == Relation.POINT).all()
    assert (found.point == b).all() and (found.t_a == 1).all() and (found.t_b == 0).all()


def test_points_and_arrays():
    assert segments_intersect([1, 1], [1, 1], [0, 0], [2, 2])
    assert not segments_intersect([1, 1], [1, 1], [0, 0], [2, 2.5])
    assert segments_intersect([1, 1], [1, 1], [1, 1], [1, 1])
    assert not segments_intersect([1, 1], [1, 1], [1, 2], [1, 2])
    rng = np.random.default_rng(4)
    table = segments_intersect(*rng.normal(size=(2, 6, 1, 2)), *rng.normal(size=(2, 5, 2)))
    assert table.shape == (6, 5) and table.any() and not table.all()
