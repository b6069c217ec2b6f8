"""Tests of the three convexity tests and of simplicity."""

from itertools import combinations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from random_polygons import HARD, convex, histograms, star_shaped
from rational import EXPONENTS, POINTS_2D, area2, common_points

from collision_monitor.errors import ShapeError
from collision_monitor.geometry.polygons import (
    corner_turns,
    interior_angles,
    is_convex,
    is_counter_clockwise,
    is_simple,
    passes_line_test,
    signed_area,
)

CONVEX = ("square", "straight corners", "needle")


def quadrilateral_is_convex(p):
    """Whether all triangles of three consecutive corners have the same orientation."""
    signs = {area2(p[i], p[(i + 1) % 4], p[(i + 2) % 4]) > 0 for i in range(4)}
    return len(signs) == 1


@pytest.mark.parametrize("name", HARD)
def test_convexity_of_the_hard_ones(name):
    polygon = np.array(HARD[name])
    assert is_convex(polygon) == is_convex(polygon[::-1]) == (name in CONVEX)
    assert is_simple(polygon)
    assert is_counter_clockwise(polygon) and not is_counter_clockwise(polygon[::-1])
    if name != "dent of one bit":  # the midpoint is rounded onto the edge, see the docstring of passes_line_test
        assert passes_line_test(polygon) == (name in CONVEX)


@settings(max_examples=40)
@given(st.tuples(POINTS_2D, POINTS_2D, POINTS_2D, POINTS_2D), EXPONENTS)
def test_quadrilaterals(points, exponent):
    polygon = np.array(points) * 2.0**exponent
    if all(area2(*three) for three in combinations(points, 3)):
        assert is_convex(polygon) == quadrilateral_is_convex(points)
        sides = [(points[i], points[(i + 1) % 4]) for i in range(4)]
        crosses = common_points(*sides[0], *sides[2]) or common_points(*sides[1], *sides[3])
        assert is_simple(polygon) == (crosses is None)


@settings(max_examples=40)
@given(st.integers(0, 2**32 - 1), st.integers(3, 12))
def test_the_three_tests_agree(seed, corners):
    rng = np.random.default_rng(seed)
    for polygon, known in ((convex(rng, corners), True), (star_shaped(rng, corners), None)):
        angles = interior_angles(polygon)
        assert abs(angles.sum() - (corners - 2) * np.pi) < 1e-12 * corners
        by_signs = is_convex(polygon)
        assert by_signs == bool((angles <= np.pi).all()) == passes_line_test(polygon) == is_convex(polygon[::-1])
        assert known in (None, by_signs)
        assert np.allclose(interior_angles(polygon[::-1]), angles[::-1], atol=1e-12)


@settings(max_examples=40)
@given(histograms())
def test_right_angled_polygons(polygon):
    angles = interior_angles(polygon)
    assert np.allclose(angles.sum(), (len(polygon) - 2) * np.pi)
    assert is_simple(polygon)
    assert is_convex(polygon) == passes_line_test(polygon) == bool((angles < 3.2).all())
    assert is_convex(polygon) == (not (corner_turns(polygon) < 0).any())


def test_one_sign_of_the_cross_products_is_not_enough():
    k = np.arange(5) * 4 * np.pi / 5
    pentagram = np.array([np.cos(k), np.sin(k)]).T
    assert len(set(np.sign(corner_turns(pentagram)))) == 1
    assert not is_convex(pentagram) and not is_simple(pentagram)


def test_repeated_corners_count_once():
    doubled = np.repeat(np.array(HARD["square"]), 2, axis=0)
    assert is_convex(doubled) and is_simple(doubled) and is_counter_clockwise(doubled)
    assert signed_area(doubled) == 1
    with pytest.raises(ShapeError, match="without length"):
        interior_angles(doubled)


def test_polygons_that_are_not_simple():
    assert not is_simple([(0, 0), (2, 2), (2, 0), (0, 2)])  # crossing edges
    assert not is_simple([(0, 0), (4, 0), (2, 0), (2, 2)])  # a spike
    assert not is_simple([(0, 0), (2, 0), (1, 1), (2, 2), (0, 2), (1, 1)])  # a corner touches a corner
    assert not is_simple([(0, 0), (4, 0), (4, 4), (2, 0), (0, 4)])  # a corner touches an edge


def test_the_area_far_from_the_origin():
    assert signed_area(np.array(HARD["L"]) + 1e9) == 3
    assert signed_area(np.array(HARD["L"])[::-1]) == -3


@pytest.mark.parametrize(
    "bad", [[], [(0, 0), (1, 0)], [(0, 0), (1, 1), (np.nan, 0)], [(0, 0, 0)] * 3, "abc", [(1, 1)] * 5]
)
def test_what_is_no_polygon_is_refused(bad):
    with pytest.raises(ShapeError, match="expected"):
        is_convex(bad)


def test_corners_on_one_line_are_refused():
    with pytest.raises(ShapeError, match="one line"):
        is_convex([(0, 0), (1, 1), (3, 3), (2, 2)])
