"""Tests of the dense grid against brute force, also in scenes that break naive grids and with resting pairs."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from collision_monitor.broad_phase.box_pairs import box_pairs
from collision_monitor.errors import InputError

Array = NDArray[np.float64]


def brute_force(centre: Array, half: Array, starts: NDArray[np.bool_]) -> NDArray[np.int64]:
    # compare centres and half extents as box_pairs does, because lower and upper bounds would round differently
    with np.errstate(invalid="ignore"):
        meet = np.all(np.abs(centre[:, None] - centre[None]) <= half[:, None] + half[None], axis=-1)
    there = ~np.isnan(centre).any(axis=1) & (half >= 0).all(axis=1)
    meet &= (starts[:, None] | starts[None]) & there[:, None] & there[None]
    return np.argwhere(np.triu(meet, k=1))


def alike(rng, n):
    return rng.uniform(0, 10, (n, 3)), rng.uniform(0.2, 0.6, (n, 3))


def one_plane(rng, n):
    return rng.uniform(0, 10, (n, 3)) * [1, 1, 0] + [0, 0, 7.7], rng.uniform(0.2, 0.6, (n, 3))


def centimetres_to_hundreds_of_metres(rng, n):
    return rng.uniform(0, 100, (n, 3)), 10 ** rng.uniform(-2, 2, (n, 3))


def one_cluster(rng, n):
    return rng.normal(0, 0.1, (n, 3)), rng.uniform(0.2, 0.6, (n, 3))


def far_apart(rng, n):
    return 1e6 * rng.integers(-3, 3, (n, 3)) + rng.normal(0, 1, (n, 3)), np.full((n, 3), 0.5)


def a_long_thin_wall(rng, n):
    half = rng.uniform(0.05, 0.1, (n, 3))
    half[3:4] = 200, 0.05, 1.5
    return rng.uniform(0, 20, (n, 3)), half


def touching_and_flat(rng, n):
    return rng.integers(0, 5, (n, 3)).astype(float), np.full((n, 3), 0.5) * [1, 1, 0]


def points(rng, n):
    return rng.integers(0, 5, (n, 3)).astype(float), np.zeros((n, 3))


def sparse(rng, n):
    return rng.uniform(0, 300, (n, 3)), rng.uniform(2, 6, (n, 3))


def fast(rng, n):
    """Bounds of swept bodies that cross many cells."""
    return rng.uniform(0, 300, (n, 3)), rng.uniform(0.2, 0.6, (n, 3)) + (rng.random((n, 3)) < 0.05) * 100


def without_end(rng, n):
    return (
        rng.choice([-1e18, 0.0, 1e18], (n, 3)),
        np.where(rng.random((n, 1)) < 0.1, np.inf, rng.uniform(0, 1e3, (n, 3))),
    )


def half_spaces_and_missing(rng, n):
    centre, half = alike(rng, n)
    half[rng.random((n, 3)) < 0.02] = np.inf
    half[rng.random((n, 3)) < 0.02] = -1
    half[rng.random((n, 3)) < 0.02] = np.nan
    centre[rng.random((n, 3)) < 0.02] = np.nan
    return centre, half


def at_the_end_of_float64(rng, n):
    half = rng.choice([0.0, 5e-324, 1e-200, 1e200, 1e308], (n, 3))
    return rng.choice([-1.7e308, -1e200, 0.0, 5e-324, 1e300], (n, 3)), half


SCENES = [
    alike, one_plane, centimetres_to_hundreds_of_metres, one_cluster, far_apart, a_long_thin_wall, touching_and_flat,
    points, sparse, fast, without_end, half_spaces_and_missing, at_the_end_of_float64,
]  # fmt: skip


@pytest.mark.parametrize("starting", [1.0, 0.3, 0.02, 0.0])
@pytest.mark.parametrize("scene", SCENES)
@pytest.mark.filterwarnings("ignore:overflow")
def test_pairs_are_those_of_brute_force(scene, starting: float) -> None:
    rng = np.random.default_rng(1)
    for n in (0, 1, 2, 20, 400):
        centre, half = scene(rng, n)
        starts = rng.random(n) < starting
        assert np.array_equal(box_pairs(centre, half, starts), brute_force(centre, half, starts).reshape(-1, 2))


number = st.one_of(st.integers(-4, 4).map(float), st.floats(-1e9, 1e9), st.floats(allow_nan=True, allow_infinity=False))
extent = st.one_of(st.integers(0, 4).map(lambda k: k / 2), st.floats(0, allow_infinity=True, allow_nan=False))


@given(st.lists(st.tuples(number, number, number, extent, extent, extent, st.booleans()), min_size=1, max_size=30))
@pytest.mark.filterwarnings("ignore:overflow")
def test_any_boxes(boxes: list[tuple[float, ...]]) -> None:
    numbers = np.array(boxes, dtype=float)
    centre, half, starts = numbers[:, :3], numbers[:, 3:6], numbers[:, 6] > 0
    assert np.array_equal(box_pairs(centre, half, starts), brute_force(centre, half, starts))


def test_resting_pairs_are_never_visited() -> None:
    """100,000 resting boxes in one place have 5e9 pairs; the moving box overlaps all of them."""
    n = 100_000
    pairs = box_pairs(np.zeros((n, 3)), np.ones((n, 3)), np.arange(n) == 5)
    assert np.array_equal(pairs, [sorted((5, j)) for j in range(n) if j != 5])


def test_bad_arrays_are_refused() -> None:
    with pytest.raises(InputError, match=r"expected centres and half extents of shape \(N, 3\), got \(2, 3\) and \(3,"):
        box_pairs(np.zeros((2, 3)), np.zeros((3, 3)))
    with pytest.raises(InputError, match="expected 2 flags"):
        box_pairs(np.zeros((2, 3)), np.zeros((2, 3)), [True])
