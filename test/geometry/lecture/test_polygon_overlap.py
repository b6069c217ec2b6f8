"""Tests of polygon overlap: the cascade against rational segments, SAT against the Minkowski difference."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from random_polygons import HARD, convex, histograms, star_shaped
from rational import EXPONENTS, common_points, in_polygon
from scipy.spatial import ConvexHull

from collision_monitor.errors import ShapeError
from collision_monitor.geometry.lecture.polygon_overlap import (
    Evidence,
    contained_vertices,
    crossing_edge_pairs,
    polygons_intersect,
    project,
    sat_2d,
)
from collision_monitor.geometry.points import closest_point_on_segment
from collision_monitor.geometry.triangulation import convex_parts

SHIFTS = st.tuples(st.integers(-5, 5), st.integers(-5, 5))


def meet(a, b):
    """Whether, in rational numbers, a corner of one polygon is in the other or two edges have a common point."""
    if any(in_polygon(p, b) >= 0 for p in a) or any(in_polygon(p, a) >= 0 for p in b):
        return True
    return any(common_points(a[i - 1], a[i], b[j - 1], b[j]) for i in range(len(a)) for j in range(len(b)))


@settings(max_examples=40)
@given(histograms(), histograms(), SHIFTS, EXPONENTS)
def test_touching_and_crossing_polygons(a, b, shift, exponent):
    a, b = a * 2.0**exponent, (b @ np.array([[1, 1], [-1, 1]]) + shift) * 2.0**exponent
    found = polygons_intersect(a, b)
    assert (found is not Evidence.SEPARATE) == meet(a, b)
    assert (polygons_intersect(b, a) is Evidence.SEPARATE) == (found is Evidence.SEPARATE)


def test_each_kind_of_evidence():
    square = np.array(HARD["square"], float)
    assert polygons_intersect(square, square * 0.2 + 0.4) is Evidence.VERTEX_OF_B
    assert polygons_intersect(square * 0.2 + 0.4, square) is Evidence.VERTEX_OF_A
    upright, flat = square * [1, 5] - [0.5, 2.5], square * [5, 1] - [2.5, 0.5]
    assert polygons_intersect(upright, flat) is Evidence.EDGES  # a cross has no contained vertex
    assert crossing_edge_pairs(upright, flat).tolist() == [[1, 0], [1, 2], [3, 0], [3, 2]]
    assert polygons_intersect(square, square + 1.5) is Evidence.SEPARATE
    assert contained_vertices(square, square + 1).tolist() == [2]
    comb = np.array(HARD["comb"])
    assert polygons_intersect(comb, square * 0.5 + [5.25, 2]) is Evidence.SEPARATE  # the square is between the teeth


@settings(max_examples=40)
@given(st.integers(0, 2**32 - 1), st.integers(3, 8), st.integers(3, 8))
def test_sat_is_the_minkowski_difference(seed, n, m):
    rng = np.random.default_rng(seed)
    a, b = convex(rng, n), convex(rng, m)
    hull = ConvexHull((b[None] - a[:, None]).reshape(-1, 2))  # contains the origin if they overlap
    depth = hull.equations[:, 2].max()  # minus the distance of the origin from the nearest side
    found = sat_2d(a, b)
    assert found.overlaps == (depth <= 0)
    if found.overlaps:
        assert abs(found.distance - depth) < 1e-13
        apart = b - (found.distance - 1e-9) * found.axis
        assert not sat_2d(a, apart).overlaps and sat_2d(a, b - (found.distance + 1e-9) * found.axis).overlaps
    else:
        pairs = [(p, q) for p in a for q in np.stack([b, np.roll(b, -1, axis=0)], axis=1)]
        pairs += [(p, q) for p in b for q in np.stack([a, np.roll(a, -1, axis=0)], axis=1)]
        true = min(np.linalg.norm(p - closest_point_on_segment(p, *q)[0]) for p, q in pairs)
        assert 0 < found.distance <= true + 1e-14
        (_, high), (low, _) = project(a, found.axis), project(b, found.axis)
        assert high < low  # the projections on the axis are apart, A's first
        assert sat_2d(a, b, found.edge).tested == 1
    swapped = sat_2d(b[::-1], a[::-1])
    assert swapped.overlaps == found.overlaps
    if found.overlaps:
        assert abs(swapped.distance - found.distance) < 1e-13


@settings(max_examples=40)
@given(histograms(), histograms(), SHIFTS, EXPONENTS)
def test_sat_of_convex_parts_agrees_with_the_cascade_also_where_they_touch(a, b, shift, exponent):
    a, b = a * 2.0**exponent, (b + shift) * 2.0**exponent
    by_parts = any(sat_2d(a[p], b[q]).overlaps for p in convex_parts(a) for q in convex_parts(b))
    assert by_parts == (polygons_intersect(a, b) is not Evidence.SEPARATE)


def test_sat_ends_at_the_first_separating_axis():
    square = np.array(HARD["square"], float)
    right = sat_2d(square, square + np.array([2, 0.5]))
    assert not right.overlaps and right.distance == 1 and right.axis.tolist() == [1, 0]
    assert (right.edge, right.tested) == (1, 2)
    over = sat_2d(square, square + np.array([0.75, 0.5]))
    assert over.overlaps and over.distance == -0.25 and over.axis.tolist() == [1, 0] and over.tested == 4
    touching = sat_2d(square, square + np.array([1, 0.3]))
    assert touching.overlaps and touching.distance == 0


def regular(corners, turn=0.0):
    angle = turn + 2 * np.pi * np.arange(corners) / corners
    return np.stack([np.cos(angle), np.sin(angle)], axis=1)


@pytest.mark.parametrize("turn", np.linspace(0, 3, 40))
def test_parallel_edges_of_a_polygon_share_an_axis(turn):
    """The lecture counts four axes of two squares: two of each."""
    for a, b, count in ((4, 4, 4), (3, 4, 5), (6, 3, 6), (8, 6, 7), (5, 5, 10)):
        first, second = regular(a, turn), regular(b, 2 * turn + 0.1) * 0.5
        assert sat_2d(first, second).tested == count
        assert sat_2d(first[::-1], second + 0.2).tested == count
    with_a_straight_corner = np.array([[0, 0], [1, 0], [2, 0], [2, 1], [0, 1]])
    assert sat_2d(with_a_straight_corner, regular(4)).tested == 4


def test_a_common_motion_changes_nothing():
    rng = np.random.default_rng(2)
    a, b = convex(rng, 6), convex(rng, 5)
    turn = np.array([[0.6, -0.8], [0.8, 0.6]])
    here, there = sat_2d(a, b), sat_2d(a @ turn.T + 1e3, b @ turn.T + 1e3)
    assert here.overlaps == there.overlaps and abs(here.distance - there.distance) < 1e-12


def test_concave_and_impossible_polygons_are_refused():
    with pytest.raises(ShapeError, match="convex_parts"):
        sat_2d(HARD["L"], HARD["square"])
    with pytest.raises(ShapeError, match="expected"):
        polygons_intersect([(0, 0), (1, 1)], HARD["square"])
    with pytest.raises(ShapeError, match="finite"):
        sat_2d([(0, 0), (1, 1), (0, np.nan)], HARD["square"])
    assert polygons_intersect(star_shaped(np.random.default_rng(0), 9), HARD["square"]) is not Evidence.SEPARATE
