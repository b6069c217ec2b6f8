"""Polygons with a radius, and capsules in the plane: against capsules in space, and against the polygon without it."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import collision_monitor as cm
from collision_monitor import Motion, Pose
from collision_monitor.errors import ShapeError

STAR = [(0, 0), (2, 0), (2, 1), (0.5, 0.2), (0, 1)]


def flat_pose(rng, reach=2.0):
    half = rng.uniform(0, np.pi)
    return Pose((*rng.uniform(-reach, reach, 2), 0.0), (0, 0, np.sin(half), np.cos(half)))


def stadium(rng):
    """A capsule in the plane, and the same in space, about the middle of its segment."""
    half, radius = rng.uniform(0.05, 1.0), rng.uniform(0.05, 0.5)
    along = Pose((0, 0, 0), (np.sqrt(0.5), 0, 0, np.sqrt(0.5)))  # z to -y
    return cm.Polygon([(0, -half), (0, half)], radius), (cm.Capsule(radius, 2 * half), along)


@settings(max_examples=150, deadline=None)
@given(st.integers(0, 2**32))
def test_a_capsule_in_the_plane_is_a_section_of_one_in_space(seed):
    rng = np.random.default_rng(seed)
    (a, solid_a), (b, solid_b) = stadium(rng), stadium(rng)
    X, Y = flat_pose(rng), flat_pose(rng)
    if seed % 3 == 0:
        Y = Pose(X.position + X.rotation @ (0, rng.uniform(-3, 3), 0), X.quaternion)  # on one line
    radii = a.radius + b.radius
    found, solid = cm.contact(a, X, b, Y), cm.contact([solid_a], X, [solid_b], Y)
    if solid.signed_distance > -radii + 1e-9:  # else the segments cross, and the way out in space leads upward
        assert found.signed_distance == pytest.approx(solid.signed_distance, abs=1e-12)
        assert found.error_bound < 1e-9
        ball = cm.contact(a, X, cm.Circle(b.radius), Y)
        in_space = cm.contact([solid_a], X, cm.Sphere(b.radius), Y)
        if in_space.signed_distance > -radii + 1e-9:
            assert ball.signed_distance == pytest.approx(in_space.signed_distance, abs=1e-12)
    else:
        moved = cm.contact(a, X, b, Pose(Y.position - (found.signed_distance - 1e-9) * found.normal, Y.quaternion))
        assert moved.signed_distance == pytest.approx(1e-9, abs=1e-11)
    swapped = cm.contact(b, Y, a, X)
    assert swapped.signed_distance == pytest.approx(found.signed_distance, abs=1e-12)


@settings(max_examples=60, deadline=None)
@given(st.integers(0, 2**32))
def test_the_radius_shortens_every_distance(seed):
    rng = np.random.default_rng(seed)
    points = rng.normal(size=(3, 2)) if seed % 2 else STAR
    X, Y, radius = flat_pose(rng), flat_pose(rng), rng.uniform(0.01, 0.3)
    other = cm.Polygon(rng.normal(size=(3, 2)))
    sharp, rounded = (cm.contact(cm.Polygon(points, r), X, other, Y) for r in (0.0, radius))
    assert rounded.signed_distance == pytest.approx(sharp.signed_distance - radius, abs=1e-12)
    if sharp.signed_distance > 0.0:
        drive = Motion(Y, linear=X.position - Y.position)
        sooner, later = (cm.time_of_impact(cm.Polygon(points, r), Motion(X), other, drive) for r in (radius, 0.0))
        assert sooner.lower <= later.lower + 1e-9


def test_a_monitor_takes_them():
    monitor = cm.Monitor()
    monitor.add(1, cm.Polygon([(0, -1), (0, 1)], 0.5))
    monitor.add(2, cm.Circle(0.25))
    result = monitor.step(0, [1, 2], [[0, 0, 0, 0, 0, 0, 1], [0, 1.5, 0, 0, 0, 0, 1]], np.zeros((2, 6)))
    assert result.contacts["signed_distance"] == pytest.approx([-0.25])


@pytest.mark.parametrize(
    ("points", "radius", "text"),
    [
        ([(0, 0), (1, 0)], 0.0, "at least 3 points"),
        ([(0, 0)], 1.0, "at least 2 points"),
        ([(1, 2), (1, 2)], 1.0, "two different points"),
        ([(0, 0), (1, 0), (0, 1)], -1.0, "Polygon radius"),
        ([(0, 0), (1, 0), (0, 1)], float("nan"), "Polygon radius"),
        ([(0, 0), (1, 0), (0, 1)], "wide", "Polygon radius"),
    ],
)
def test_impossible_ones_are_refused(points, radius, text):
    with pytest.raises(ShapeError, match=text):
        cm.Polygon(points, radius)


@pytest.mark.parametrize("radii", [(1, 2), (1, 2, 0), (1, 2, float("nan")), 3.0, "abc", (1, 2, -3), (1, 2, 3, 4)])
def test_impossible_ellipsoids_are_refused(radii):
    with pytest.raises(ShapeError, match="Ellipsoid radii"):
        cm.Ellipsoid(radii)
