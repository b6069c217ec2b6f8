"""Tests that bounding spheres contain their points exactly, and that the minimal one is the smallest possible."""

from fractions import Fraction
from itertools import combinations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from point_sets import SETS, rotation

from collision_monitor.errors import ShapeError
from collision_monitor.geometry.bounding_spheres import (
    minimal_sphere,
    sphere_from_centroid,
    sphere_from_widest_pair,
    sphere_grown,
)

ALL = (sphere_from_centroid, sphere_from_widest_pair, sphere_grown, minimal_sphere)


def through(points):
    """Centre of the smallest sphere through the points, by the linear system of equal distances."""
    edges = points[1:] - points[0]
    return points[0] + np.linalg.pinv(2 * edges) @ (edges**2).sum(axis=1)


def smallest_radius(points):
    """Smallest radius over all spheres defined by 2, 3 or 4 of the points."""
    best = np.inf
    for k in range(2, points.shape[1] + 2):
        for chosen in combinations(range(len(points)), k):
            center = through(points[list(chosen)])
            reach = np.linalg.norm(points - center, axis=1)
            if reach.max() <= reach[chosen[0]] * (1 + 1e-9):
                best = min(best, reach.max())
    return best


@pytest.mark.parametrize("name", SETS)
@pytest.mark.parametrize("make", ALL)
def test_it_holds_its_points_in_rational_numbers(name, make):
    points = SETS[name]
    sphere = make(points)
    center, radius = [Fraction(float(x)) for x in sphere.center], Fraction(float(sphere.radius))
    for p in points:
        assert sum((Fraction(float(x)) - c) ** 2 for x, c in zip(p, center, strict=True)) <= radius**2
    assert sphere.radius >= minimal_sphere(points).radius * (1 - 1e-9)


@settings(max_examples=25)
@given(st.integers(0, 2**32 - 1), st.integers(2, 9), st.sampled_from([2, 3]), st.integers(-9, 9))
def test_the_minimal_one_is_the_smallest_of_all_that_points_define(seed, count, dimension, exponent):
    points = np.random.default_rng(seed).normal(size=(count, dimension)) * 10.0**exponent
    assert abs(minimal_sphere(points).radius / smallest_radius(points) - 1) < 1e-9


@given(st.lists(st.tuples(*[st.integers(0, 2)] * 3), min_size=2, max_size=6, unique=True))
@settings(max_examples=25)
def test_many_points_on_one_sphere(points):
    points = np.array(points, float)
    assert abs(minimal_sphere(points).radius / smallest_radius(points) - 1) < 1e-9


def test_known_spheres():
    assert np.allclose(minimal_sphere(SETS["cube"]).radius, 3**0.5, rtol=1e-12)
    assert np.allclose(minimal_sphere(SETS["lattice"]).center, 1.5, rtol=1e-12)
    assert np.allclose(minimal_sphere(SETS["ball"]).radius, 1, rtol=1e-3)
    for make in ALL:
        assert make(SETS["one point"]).radius == 0
        assert make([[3.0, 4.0]]).center.tolist() == [3, 4]
    widest = sphere_from_widest_pair([[0.0, 0], [4, 0], [2, 1]])
    assert widest.center.tolist() == [2, 0] and abs(widest.radius - 2) < 1e-14
    centroid = sphere_from_centroid([[0.0, 0], [4, 0], [2, 3]])
    assert centroid.center.tolist() == [2, 1] and abs(centroid.radius - 5**0.5) < 1e-14


def test_each_is_as_loose_as_said():
    crowded = SETS["crowded at one end"]
    least = minimal_sphere(crowded).radius
    assert sphere_from_centroid(crowded).radius > 1.9 * least
    assert sphere_grown(crowded).radius < 1.1 * least
    for name in ("cloud", "ball", "cube", "lattice", "turned box"):
        least = minimal_sphere(SETS[name]).radius
        assert sphere_grown(SETS[name]).radius < 1.25 * least
        assert sphere_from_widest_pair(SETS[name]).radius < 1.25 * least


@pytest.mark.parametrize("name", ["cloud", "crowded at one end", "lattice", "needle"])
def test_order_and_place_do_not_matter_to_the_minimal_one(name):
    points = SETS[name]
    rng = np.random.default_rng(0)
    radius = minimal_sphere(points).radius
    assert abs(minimal_sphere(rng.permutation(points)).radius / radius - 1) < 1e-9
    turned = points @ rotation(7).T + [5, -3, 2]
    assert abs(minimal_sphere(turned).radius / radius - 1) < 1e-9


def test_many_points():
    points = np.random.default_rng(1).normal(size=(20_000, 3))
    sphere = minimal_sphere(points)
    reach = np.linalg.norm(points - sphere.center, axis=1)
    on_it = points[reach > sphere.radius * (1 - 1e-9)]
    assert 2 <= len(on_it) <= 4
    # the smallest sphere has its centre in the hull of the points on it
    weights = np.linalg.lstsq(np.vstack([on_it.T, np.ones(len(on_it))]), [*sphere.center, 1], rcond=None)[0]
    assert (weights > 0).all()


@pytest.mark.parametrize("make", ALL)
@pytest.mark.parametrize("bad", [[], [[np.nan, 0, 0]], [[1, 2, 3, 4]], [1, 2, 3]])
def test_bad_points_are_refused(make, bad):
    with pytest.raises(ShapeError, match="expected"):
        make(bad)
