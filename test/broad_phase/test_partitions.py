"""Tests of every space partition against brute force, in space and in the plane."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from collision_monitor.broad_phase.aabb_tree import aabb_tree
from collision_monitor.broad_phase.brute_force import overlapping_pairs
from collision_monitor.broad_phase.octree import octree_overlaps
from collision_monitor.broad_phase.partitions import PARTITIONS, quadtree_overlaps
from collision_monitor.errors import InputError

SCENES = {
    "alike": lambda rng, n, d: (rng.uniform(0, 10, (n, d)), rng.uniform(0.2, 0.6, (n, d))),
    "1 cm to 100 m": lambda rng, n, d: (rng.uniform(0, 100, (n, d)), 10 ** rng.uniform(-2, 2, (n, d))),
    "on a lattice, touching": lambda rng, n, d: (rng.integers(0, 6, (n, d)) * 1.0, np.full((n, d), 1.0)),
    "1e6 m apart": lambda rng, n, d: (1e6 * rng.integers(-3, 3, (n, d)) + rng.normal(0, 1, (n, d)), np.ones((n, d))),
    "all in one place": lambda rng, n, d: (np.ones((n, d)), np.zeros((n, d))),
    "in a line": lambda rng, n, d: (np.arange(n)[:, None] * np.eye(d)[1], rng.uniform(0.2, 1.2, (n, d))),
}


def plain(lower, upper):
    """The pairs that overlap or touch, one by one."""
    n = len(lower)
    found = [
        (i, j)
        for i in range(n)
        for j in range(i + 1, n)
        if (lower[i] <= upper[j]).all() and (lower[j] <= upper[i]).all()
    ]
    return np.array(found).reshape(-1, 2)


@pytest.mark.parametrize("dimension", [2, 3])
@pytest.mark.parametrize("count", [0, 1, 2, 3, 200])
@pytest.mark.parametrize("scene", SCENES)
@pytest.mark.parametrize("name", PARTITIONS)
def test_pairs_are_those_of_a_plain_comparison(name, scene, count, dimension):
    lower, size = SCENES[scene](np.random.default_rng(dimension - 2), count, dimension)
    np.testing.assert_array_equal(PARTITIONS[name](lower, lower + size), plain(lower, lower + size))


@pytest.mark.parametrize("scene", SCENES)
def test_in_the_plane_the_octree_is_the_quadtree(scene):
    lower, size = SCENES[scene](np.random.default_rng(2), 150, 2)
    np.testing.assert_array_equal(octree_overlaps(lower, lower + size), quadtree_overlaps(lower, lower + size))


numbers = st.floats(-1e3, 1e3).map(lambda x: round(x, 1))
sizes = st.sampled_from([0.0, 1e-9, 0.1, 1.0, 500.0])
boxes = st.lists(st.tuples(*[numbers] * 3, *[sizes] * 3), min_size=1, max_size=12)


@settings(max_examples=50)
@given(boxes)
def test_any_boxes(rows):
    lower, size = np.split(np.array(rows), 2, axis=1)
    expected = overlapping_pairs(lower, lower + size)
    for name, partition in PARTITIONS.items():
        np.testing.assert_array_equal(partition(lower, lower + size), expected, err_msg=name)


def test_nodes_of_the_tree_hold_their_boxes():
    rng = np.random.default_rng(3)
    lower = rng.uniform(0, 10, (37, 3))
    upper = lower + rng.uniform(0, 1, (37, 3))
    tree = aabb_tree(lower, upper)
    assert sorted(tree.order) == list(range(37))
    for k, (low, high) in enumerate(zip(tree.lower, tree.upper, strict=True)):
        assert len(low) == 2**k
        node = np.repeat(np.arange(2**k), np.diff(np.append(np.arange(2**k) * 37 >> k, 37)))
        assert (low[node] <= lower[tree.order]).all() and (upper[tree.order] <= high[node]).all()


@pytest.mark.parametrize("name", PARTITIONS)
def test_boxes_without_end_inside_out_or_of_other_dimensions_are_refused(name):
    for lower, upper in (
        ([[0, 0, 0]], [[1, 1, np.inf]]),
        ([[0, 0, 2]], [[1, 1, 1]]),
        ([0, 0, 0], [1, 1, 1]),
        ([[0]], [[1]]),
        ([[0, 0, 0, 0]], [[1, 1, 1, 1]]),
        ([[0, 0]], [[1, 1, 1]]),
        ([[0, 0]], [[1, 1], [2, 2]]),
    ):
        with pytest.raises(InputError, match="boxes: expected"):
            PARTITIONS[name](np.array(lower, float), np.array(upper, float))
