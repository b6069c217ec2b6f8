"""Tests that triangles and convex parts fill the polygon, do not overlap, and use only its corners."""

from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from random_polygons import HARD, convex, histograms, star_shaped
from rational import EXPONENTS, area2

from collision_monitor.errors import ShapeError
from collision_monitor.geometry.point_in_polygon import Location, locate_in_polygon
from collision_monitor.geometry.polygons import is_convex
from collision_monitor.geometry.triangulation import convex_parts, triangulate


def twice_area(polygon):
    """Twice the area, exactly."""
    return sum((area2(polygon[0], polygon[i], polygon[i + 1]) for i in range(1, len(polygon) - 1)), Fraction(0))


def check(polygon):
    polygon = np.asarray(polygon, float)
    triangles, parts = triangulate(polygon), convex_parts(polygon)
    assert triangles.shape == (len(polygon) - 2, 3)
    total = abs(twice_area(polygon))
    for pieces in (list(triangles), parts):
        areas = [twice_area(polygon[piece]) for piece in pieces]
        assert min(areas) > 0  # counter-clockwise, none flat
        assert sum(areas) == total
        assert all(is_convex(polygon[piece]) for piece in pieces)
        # the areas add up, so pieces inside the polygon do not overlap; each inner edge occurs once in each direction
        directed = [(int(p[k - 1]), int(p[k])) for p in pieces for k in range(len(p))]
        assert len(set(directed)) == len(directed)
        inner = [edge for edge in directed if edge[::-1] in directed]
        assert len(directed) - len(inner) == len(polygon)
    assert len(parts) <= len(triangles)
    turns = [area2(p, q, r) for p, q, r in zip(np.roll(polygon, 1, 0), polygon, np.roll(polygon, -1, 0), strict=True)]
    reflex = sum(turn * twice_area(polygon) < 0 for turn in turns)
    # at least one part per two reflex corners is needed; Hertel–Mehlhorn leaves at most two diagonals per reflex corner
    assert (reflex + 1) // 2 + 1 <= len(parts) <= 2 * reflex + 1
    return parts


@pytest.mark.parametrize("name", HARD)
@pytest.mark.parametrize("clockwise", [False, True])
def test_the_hard_ones(name, clockwise):
    check(HARD[name][::-1] if clockwise else HARD[name])


@settings(max_examples=30)
@given(st.integers(0, 2**32 - 1), st.integers(3, 25), EXPONENTS)
def test_random_polygons(seed, corners, exponent):
    check(star_shaped(np.random.default_rng(seed), corners) * 2.0**exponent)


@settings(max_examples=30)
@given(histograms(), st.integers(0, 20))
def test_right_angles_and_straight_corners(polygon, first):
    check(np.roll(polygon, first, axis=0))


def test_convex_ones_stay_whole():
    assert [len(part) for part in convex_parts(convex(np.random.default_rng(0), 40))] == [40]


def test_the_parts_hold_the_same_points():
    rng = np.random.default_rng(5)
    polygon, points = star_shaped(rng, 30), rng.uniform(-1, 1, (500, 2))
    inside = np.any(
        [locate_in_polygon(points, polygon[part]) != Location.OUTSIDE for part in convex_parts(polygon)], axis=0
    )
    assert (inside == (locate_in_polygon(points, polygon) != Location.OUTSIDE)).all()


def test_a_repeated_corner_is_used_once():
    doubled = np.repeat(np.array(HARD["L"], float), 2, axis=0)
    assert triangulate(doubled).shape == (4, 3)


@pytest.mark.parametrize(
    "bad",
    [
        [(0, 0), (2, 2), (2, 0), (0, 2)],
        [(0, 0), (4, 0), (2, 0), (2, 2)],
        [(0, 0), (1, 1), (2, 2)],
        [(0, 0), (1, 0)],
        [(0, 0), (1, 0), (0, np.inf)],
    ],
)
def test_what_is_not_simple_is_refused(bad):
    with pytest.raises(ShapeError, match="expected"):
        triangulate(bad)
    with pytest.raises(ShapeError, match="expected"):
        convex_parts(bad)
