"""Tests that oriented boxes contain their points exactly, and of the minimum volume against known values."""

from fractions import Fraction

import numpy as np
import pytest
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st
from point_sets import SETS, rotation

from collision_monitor.errors import ShapeError
from collision_monitor.geometry.bounding_volumes import aabb, convex_hull
from collision_monitor.geometry.oriented_boxes import obb_minimum_volume, obb_pca

BOTH = (obb_pca, obb_minimum_volume)


@pytest.mark.parametrize("name", SETS)
@pytest.mark.parametrize("make", BOTH)
def test_it_holds_its_points_in_rational_numbers(name, make):
    points = SETS[name]
    box = make(points)
    assert np.abs(box.rotation.T @ box.rotation - np.eye(3)).max() < 1e-14 and np.linalg.det(box.rotation) > 0
    center = [Fraction(float(x)) for x in box.center]
    for axis, half in zip(box.rotation.T, box.half_extents, strict=True):
        normal = [Fraction(float(a)) for a in axis]
        offsets = [[Fraction(float(x)) - c for x, c in zip(p, center, strict=True)] for p in points]
        reach = [sum(a * x for a, x in zip(normal, offset, strict=True)) for offset in offsets]
        assert max(map(abs, reach)) <= half
        slack = 1e-13 * np.ptp(points, axis=0).max() + 1e-15 * np.abs(points).max()
        assert float(max(reach)) >= half - slack and float(min(reach)) <= -half + slack  # touches on both sides


@pytest.mark.parametrize(("name", "volume"), [("cube", 8), ("turned box", 24), ("tetrahedron", 8), ("lattice", 27)])
def test_the_minimum_where_it_is_known(name, volume):
    for turn in (np.eye(3), rotation(3), rotation(8)):
        assert abs(obb_minimum_volume(SETS[name] @ turn.T).volume / volume - 1) < 1e-12


@settings(max_examples=10)
@given(st.integers(0, 2**32 - 1), st.integers(4, 40), st.integers(-9, 9))
def test_never_looser_than_the_others_and_never_below_the_hull(seed, count, exponent):
    points = np.random.default_rng(seed).normal(size=(count, 3)) * 10.0**exponent
    volume = obb_minimum_volume(points).volume
    assert convex_hull(points).volume * (1 - 1e-12) <= volume
    assert volume <= min(obb_pca(points).volume, aabb(points).volume) * (1 + 1e-12)
    by_trimesh = np.prod(trimesh.bounds.oriented_bounds(points / 10.0**exponent)[1]) * 10.0 ** (3 * exponent)
    assert volume <= by_trimesh * (1 + 1e-9)


def test_a_round_hull_of_thousands_of_faces():
    directions = np.random.default_rng(0).normal(size=(1500, 3))
    points = directions / np.linalg.norm(directions, axis=1, keepdims=True) * [3, 2, 1]
    box = obb_minimum_volume(points @ rotation(2).T)
    assert len(convex_hull(points).faces) > 2900
    assert np.allclose(np.sort(box.half_extents), [1, 2, 3], rtol=0.02)


def test_flat_points_get_the_smallest_rectangle():
    rectangle = np.array([[0, 0, 0], [3, 0, 0], [3, 1, 0], [0, 1, 0], [1, 0.5, 0], [0.2, 0.1, 0]]) @ rotation(5).T
    box = obb_minimum_volume(rectangle)
    assert np.allclose(np.sort(box.half_extents), [0, 0.5, 1.5], atol=1e-14)
    line = obb_minimum_volume(SETS["line"])
    assert np.allclose(np.sort(line.half_extents), [0, 0, 14**0.5 / 2], atol=1e-14)


@pytest.mark.parametrize("make", BOTH)
def test_corners_and_motion(make):
    points = SETS["cloud"]
    box = make(points)
    assert box.corners.shape == (8, 3)
    assert np.allclose(box.corners.mean(axis=0), box.center)
    assert abs(convex_hull(box.corners).volume / box.volume - 1) < 1e-12
    moved = make(points @ rotation(6).T + [1, 2, 3])
    assert abs(moved.volume / box.volume - 1) < 1e-9
    assert abs(make(np.random.default_rng(0).permutation(points)).volume / box.volume - 1) < 1e-9


@pytest.mark.parametrize("make", BOTH)
@pytest.mark.parametrize("bad", [[], [[np.nan, 0, 0]], [[1, 2]], [1, 2, 3]])
def test_bad_points_are_refused(make, bad):
    with pytest.raises(ShapeError, match="expected"):
        make(bad)
