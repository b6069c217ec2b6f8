"""Tests of point in polygon against a rational ray that meets no corner."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from random_polygons import HARD, convex, histograms, star_shaped
from rational import EXPONENTS, in_polygon

from collision_monitor.errors import InputError
from collision_monitor.geometry.point_in_polygon import Location, locate_in_convex, locate_in_polygon

HALVES = st.integers(-1, 12).map(lambda n: n / 2)


@settings(max_examples=40)
@given(histograms(), st.lists(st.tuples(HALVES, HALVES), min_size=1, max_size=8), EXPONENTS)
def test_rays_through_corners_and_along_edges(polygon, points, exponent):
    expected = [in_polygon(p, polygon) for p in points]
    scale = 2.0**exponent
    for turn in ([[1, 0], [0, 1]], [[0, -1], [1, 0]], [[-1, 0], [0, -1]], [[1, 1], [-1, 1]], [[1, 0], [0, -1]]):
        moved, where = polygon @ np.array(turn) * scale, np.array(points) @ np.array(turn) * scale
        assert locate_in_polygon(where, moved).tolist() == expected
        assert locate_in_polygon(where, np.roll(moved[::-1], 2, axis=0)).tolist() == expected


@pytest.mark.parametrize("name", HARD)
def test_the_hard_ones(name):
    polygon = np.array(HARD[name], float)
    rng = np.random.default_rng(0)
    corners = polygon[rng.integers(len(polygon), size=(40, 3))]
    points = np.vstack([polygon, corners[:, :2].mean(axis=1), corners.mean(axis=1), np.nextafter(polygon, 10)])
    assert locate_in_polygon(points, polygon).tolist() == [in_polygon(p, polygon) for p in points]


@settings(max_examples=40)
@given(st.integers(0, 2**32 - 1), st.integers(3, 9))
def test_random_polygons(seed, corners):
    rng = np.random.default_rng(seed)
    polygon, points = star_shaped(rng, corners), rng.uniform(-1, 1, (6, 2))
    assert locate_in_polygon(points, polygon).tolist() == [in_polygon(p, polygon) for p in points]


@settings(max_examples=25)
@given(st.integers(0, 2**32 - 1), st.integers(3, 9))
def test_the_sided_test_agrees_on_convex_ones(seed, corners):
    rng = np.random.default_rng(seed)
    polygon = convex(rng, corners)
    points = np.vstack([rng.uniform(-2, 2, (20, 2)), polygon, (polygon + np.roll(polygon, 1, axis=0)) / 2])
    assert locate_in_convex(points, polygon).tolist() == locate_in_polygon(points, polygon).tolist()
    assert locate_in_convex(points, polygon[::-1]).tolist() == locate_in_polygon(points, polygon).tolist()


def test_leading_dimensions_and_names():
    square = HARD["square"]
    assert locate_in_polygon([0.5, 0.5], square) == Location.INSIDE
    assert locate_in_polygon([[[0.5, 1]], [[2, 0.5]]], square).tolist() == [[Location.BOUNDARY], [Location.OUTSIDE]]
    assert locate_in_convex([[[0.5, 1]], [[2, 0.5]]], square).tolist() == [[Location.BOUNDARY], [Location.OUTSIDE]]
    assert locate_in_convex([0.5, 0.5], np.repeat(square, 2, axis=0)) == Location.INSIDE


@pytest.mark.parametrize("bad", [[np.nan, 0], [], [1, 2, 3]])
def test_bad_points_are_refused(bad):
    with pytest.raises(InputError, match="expected"):
        locate_in_polygon(bad, HARD["square"])
    with pytest.raises(InputError, match="expected"):
        locate_in_convex(bad, HARD["square"])
