"""Circles and polygons in the plane against Minkowski differences, distances of edges, and exact predicates."""

from __future__ import annotations

from decimal import Decimal, localcontext

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial import ConvexHull as Qhull

from collision_monitor import Circle, Polygon, Pose, contact
from collision_monitor.geometry.lecture.closest_points import closest_points
from collision_monitor.geometry.lecture.polygon_overlap import Evidence, polygons_intersect
from collision_monitor.geometry.lines import LineKind

L_SHAPE = Polygon([(0, 0), (2, 0), (2, 1), (1, 1), (1, 2), (0, 2)])


def convex(rng, n):
    points = rng.normal(size=(n, 2))
    return Polygon(points[Qhull(points).vertices][:: rng.choice([-1, 1])])


def pose(rng, reach=2.0):
    half = rng.uniform(0, np.pi)
    return Pose((*rng.uniform(-reach, reach, 2), 0), (0, 0, np.sin(half), np.cos(half)))


def placed(polygon, pose):
    return polygon.points @ pose.rotation[:2, :2].T + pose.position[:2]


def distance(p, q):
    """Least distance of the edges of two polygons that do not meet."""
    i, j = np.indices((len(p), len(q))).reshape(2, -1)
    p3, q3 = (np.pad(x, ((0, 0), (0, 1))) for x in (p, q))
    u, v = np.roll(p3, -1, 0) - p3, np.roll(q3, -1, 0) - q3
    return closest_points(p3[i], u[i], q3[j], v[j], LineKind.SEGMENT, LineKind.SEGMENT).distance.min()


def depth(p, q):
    """Depth of two overlapping convex polygons: distance of the origin to the border of their Minkowski difference."""
    hull = Qhull((q[:, None] - p[None]).reshape(-1, 2))
    return float((-hull.equations[:, 2]).min())


@settings(max_examples=150, deadline=None)
@given(st.integers(0, 2**32))
def test_convex_polygons_against_the_minkowski_difference(seed):
    rng = np.random.default_rng(seed)
    a, b = convex(rng, rng.integers(3, 12)), convex(rng, rng.integers(3, 12))
    X, Y = pose(rng), pose(rng)
    p, q = placed(a, X), placed(b, Y)
    c = contact(a, X, b, Y)
    overlap = polygons_intersect(p, q) is not Evidence.SEPARATE
    expected = -depth(p, q) if overlap else distance(p, q)
    assert c.signed_distance == pytest.approx(expected, abs=1e-12)
    assert abs(c.signed_distance - expected) <= c.error_bound + 1e-14  # the oracle rounds too
    assert c.normal[2] == 0.0
    assert np.linalg.norm(c.normal) == pytest.approx(1.0, abs=1e-15)
    # both points are on the boundary of their shape
    for point, polygon in ((c.point_a, p), (c.point_b, q)):
        along = np.roll(polygon, -1, 0) - polygon
        t = np.clip(((point[:2] - polygon) * along).sum(1) / (along**2).sum(1), 0, 1)
        assert np.linalg.norm(polygon + t[:, None] * along - point[:2], axis=1).min() < 1e-12
    s = contact(b, Y, a, X)
    assert s.signed_distance == pytest.approx(c.signed_distance, abs=1e-14)


@pytest.mark.parametrize("aside", [2.0**-k for k in (4, 10, 14, 16, 20, 24, 28, 40, 52)])
@pytest.mark.parametrize("gap", [2.0**-k for k in (0, 10, 20, 30)])
def test_corners_nearly_across_an_edge(gap, aside):
    """Two corners are nearest, along a direction close to an edge's normal; the gap across that edge is shorter."""
    low = Polygon([(-1, -1), (0, -1), (0, 0), (-1, 0)])
    high = Polygon([(0, 0), (1, 1), (0.5, 2)])
    c = contact(low, Pose(), high, Pose((aside, gap, 0)))
    with localcontext() as context:
        context.prec = 60
        expected = float((Decimal(gap) ** 2 + Decimal(aside) ** 2).sqrt())
    assert abs(c.signed_distance - expected) <= c.error_bound <= 1e-13
    np.testing.assert_allclose(c.point_a, (0, 0, 0), atol=1e-13)
    np.testing.assert_allclose(c.point_b, (aside, gap, 0), atol=1e-13)
    # if the corners are clearly offset, their difference is the normal
    if aside > 1e-12:
        np.testing.assert_allclose(c.normal, np.array([aside, gap, 0]) / np.hypot(aside, gap), atol=1e-9)


@settings(max_examples=100, deadline=None)
@given(st.integers(0, 2**32))
def test_a_circle_is_a_grown_point(seed):
    rng = np.random.default_rng(seed)
    a, radius, X, Y = convex(rng, 6), rng.uniform(0.01, 1), pose(rng), pose(rng)
    p, centre = placed(a, X), Y.position[:2]
    c = contact(a, X, Circle(radius), Y)
    hull = Qhull(p)
    inside = (hull.equations @ [*centre, 1.0]).max()
    i = np.roll(p, -1, 0)
    t = np.clip(((centre - p) * (i - p)).sum(1) / ((i - p) ** 2).sum(1), 0, 1)
    outside = np.linalg.norm(p + t[:, None] * (i - p) - centre, axis=1).min()
    expected = (inside if inside < 0 else outside) - radius
    assert c.signed_distance == pytest.approx(expected, abs=1e-12)
    other = contact(Circle(0.3), X, Circle(radius), Y)
    apart = np.linalg.norm(Y.position - X.position)
    assert other.signed_distance == pytest.approx(apart - 0.3 - radius, abs=1e-14)


def test_what_stands_out_of_the_plane_is_not_looked_at():
    low, high = Pose((0, 0, -5)), Pose((1.5, 0, 7))
    assert contact(Circle(1), low, Circle(1), high).signed_distance == -0.5


def test_concave_polygons_are_their_convex_parts():
    c = contact(L_SHAPE, Pose(), Circle(0.3), Pose((1.5, 1.5, 0)))
    assert c.signed_distance == pytest.approx(0.2, abs=1e-15)
    np.testing.assert_allclose(abs(c.normal[:2]).max(), 1.0)
    deep = contact(L_SHAPE, Pose(), Circle(0.3), Pose((0.5, 0.5, 0)))
    # the way out is to the left or down: half a metre and the radius
    assert deep.signed_distance - deep.error_bound <= -0.8 <= deep.signed_distance + deep.error_bound


@settings(max_examples=60, deadline=None)
@given(st.integers(0, 2**32))
def test_concave_polygons_meet_exactly_where_the_predicates_say(seed):
    rng = np.random.default_rng(seed)
    X, Y = pose(rng), pose(rng)
    c = contact(L_SHAPE, X, L_SHAPE, Y)
    p, q = placed(L_SHAPE, X), placed(L_SHAPE, Y)
    if polygons_intersect(p, q) is Evidence.SEPARATE:
        assert c.signed_distance == pytest.approx(distance(p, q), abs=1e-12)
    else:
        assert c.signed_distance <= c.error_bound


@pytest.mark.parametrize("scale", [1e-9, 1e-3, 1e3, 1e9])
def test_scale_and_distance_from_the_origin_cost_no_digits(scale):
    rng = np.random.default_rng(7)
    for _ in range(20):
        a, b, X, Y = convex(rng, 6), convex(rng, 5), pose(rng), pose(rng)
        c = contact(a, X, b, Y)
        big = contact(
            Polygon(a.points * scale),
            Pose(X.position * scale, X.quaternion),
            Polygon(b.points * scale),
            Pose(Y.position * scale, Y.quaternion),
        )
        assert big.signed_distance == pytest.approx(c.signed_distance * scale, abs=1e-13 * scale)


def test_touching_corners_edges_and_identical_polygons():
    square = Polygon([(0, 0), (1, 0), (1, 1), (0, 1)])
    assert contact(square, Pose(), square, Pose((1, 1, 0))).signed_distance == 0.0
    assert contact(square, Pose(), square, Pose((1, 0.25, 0))).signed_distance == 0.0
    assert contact(square, Pose(), square, Pose()).signed_distance == -1.0
    assert contact(Circle(1), Pose(), Circle(1), Pose()).signed_distance == -2.0
    # resting on a long edge: the point is in the middle of the common part
    c = contact(Polygon([(-5, -1), (5, -1), (5, 0), (-5, 0)]), Pose(), square, Pose((2, -0.25, 0)))
    np.testing.assert_allclose(c.point_a, (2.5, 0, 0))
    np.testing.assert_allclose(c.point_b, (2.5, -0.25, 0))
