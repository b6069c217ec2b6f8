"""Tests of the hashed grid against brute force after insertions, moves and removals."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from collision_monitor.broad_phase.brute_force import overlapping_pairs
from collision_monitor.broad_phase.hashed_grid import HashedGrid, make_hashed_grid, put_boxes, query_boxes, remove_boxes


def found_pairs(grid: HashedGrid, which: NDArray[np.int32]) -> NDArray[np.int64]:
    pairs = np.empty((1, 2), np.int32)
    n = query_boxes(grid, which, pairs)
    pairs = np.empty((n, 2), np.int32)
    assert query_boxes(grid, which, pairs) == n
    pairs = pairs[pairs[:, 0] < pairs[:, 1]].astype(np.int64)
    return pairs[np.lexsort((pairs[:, 1], pairs[:, 0]))]


def check(grid: HashedGrid, centre: NDArray[np.float64], half: NDArray[np.float64], inside: NDArray[np.int32]) -> None:
    # compare centres and half extents as the grid does, because lower and upper bounds would round differently
    apart = np.abs(centre[inside, None] - centre[None, inside])
    meet = np.all(apart <= half[inside, None] + half[None, inside], axis=-1)
    expected = inside[np.argwhere(np.triu(meet, k=1))]
    found = found_pairs(grid, inside)
    assert np.array_equal(found, expected.reshape(-1, 2))


SCENES = {
    "alike": lambda rng, n: (rng.uniform(0, 10, (n, 3)), rng.uniform(0.2, 0.6, (n, 3))),
    "1 cm to 100 m": lambda rng, n: (rng.uniform(0, 100, (n, 3)), 10 ** rng.uniform(-2, 2, (n, 3))),
    "one cluster": lambda rng, n: (rng.normal(0, 0.1, (n, 3)), rng.uniform(0.2, 0.6, (n, 3))),
    "1e6 m apart": lambda rng, n: (1e6 * rng.integers(-3, 3, (n, 3)) + rng.normal(0, 1, (n, 3)), np.full((n, 3), 0.5)),
    "long wall": lambda rng, n: (
        rng.uniform(0, 20, (n, 3)),
        np.where(np.arange(n)[:, None] == 3, [200.0, 0.05, 1.5], rng.uniform(0.05, 0.1, (n, 3))),
    ),
    "flat, touching, equal": lambda rng, n: (
        rng.integers(0, 5, (n, 3)).astype(float),
        np.full((n, 3), 0.5) * [1, 1, 0],
    ),
    "beyond float32": lambda rng, n: (
        rng.choice([-1e60, 0.0, 1e-60, 1e60], (n, 3)),
        10.0 ** rng.choice([-60, -45, 0, 45, 60], (n, 1)) * np.ones((1, 3)),
    ),
    "corner of a large box": lambda rng, n: (
        np.where(np.arange(n)[:, None] % 2, 1e6, 1e-9 * rng.integers(-3, 4, (n, 3))),
        np.where(np.arange(n)[:, None] % 2, 1e6, 1e-9) * np.ones((1, 3)),
    ),
    "far out and without end": lambda rng, n: (
        rng.choice([-1e18, 0.0, 1e18], (n, 3)),
        np.where(rng.random((n, 1)) < 0.1, np.inf, rng.uniform(0, 1e3, (n, 3))),
    ),
}


@pytest.mark.parametrize("scene", SCENES)
def test_pairs_are_those_of_brute_force_also_after_moves(scene: str) -> None:
    rng = np.random.default_rng(1)
    n = 300
    centre, half = SCENES[scene](rng, n)
    grid = make_hashed_grid(n)
    everyone = np.arange(n, dtype=np.int32)
    put_boxes(grid, everyone, centre, half)
    check(grid, centre, half, everyone)
    some = rng.choice(everyone, n // 3, replace=False).astype(np.int32)
    other_centre, other_half = SCENES[scene](rng, n)
    centre[some], half[some] = other_centre[some], other_half[some]
    put_boxes(grid, some, centre, half)
    check(grid, centre, half, everyone)
    gone = rng.choice(everyone, n // 4, replace=False).astype(np.int32)
    remove_boxes(grid, gone)
    remove_boxes(grid, gone)  # a second removal changes nothing
    check(grid, centre, half, np.setdiff1d(everyone, gone).astype(np.int32))


def test_brute_force_compares_bounds() -> None:
    lower = np.array([[0.0, 0, 0], [1, 1, 1], [3, 0, 0]])
    assert overlapping_pairs(lower, lower + 1.0).tolist() == [[0, 1]]


coordinate = st.floats(-1e6, 1e6, allow_nan=False)
extent = st.floats(0, 1e3, allow_nan=False)


@given(st.lists(st.tuples(coordinate, coordinate, coordinate, extent, extent, extent), min_size=1, max_size=12))
def test_any_boxes(boxes: list[tuple[float, ...]]) -> None:
    numbers = np.array(boxes)
    centre, half = np.ascontiguousarray(numbers[:, :3]), np.ascontiguousarray(numbers[:, 3:])
    grid = make_hashed_grid(len(boxes))
    everyone = np.arange(len(boxes), dtype=np.int32)
    put_boxes(grid, everyone, centre, half)
    check(grid, centre, half, everyone)
