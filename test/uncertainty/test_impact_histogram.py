"""Times and probability by bins, against the same quantiles of the sorted samples."""

from __future__ import annotations

from math import inf

import numpy as np
import pytest

from collision_monitor.uncertainty.impact_distribution import (
    EARLIEST,
    EVENLY_OUTWARD,
    LATEST,
    MOST_LIKELY,
    OUTWARD,
    PROBABILITY,
    summarise,
)
from collision_monitor.uncertainty.impact_histogram import BINS, NOT_FOUND, summarise_by_bins
from collision_monitor.uncertainty.plane_memory import make_plane_memory
from collision_monitor.uncertainty.samples.normal_samples import WIDENED, sample_columns

LATTICE = sample_columns(512)


def both(times: np.ndarray) -> tuple[np.ndarray, np.ndarray, float]:
    """Answers (4,) of sorted samples and of bins, and the first impact."""
    weights = LATTICE.weights[: len(times)]
    by_order, by_bins = np.empty(4), np.empty(4)
    summarise(times, weights, np.argsort(times, kind="stable"), 0.95, 0.0, by_order, weights.sum())
    first = summarise_by_bins(times, LATTICE.weights, LATTICE.sums, OUTWARD, 0.95, make_plane_memory(512), by_bins)
    return by_order, by_bins, first


@pytest.mark.parametrize("samples", [256, 512])
@pytest.mark.parametrize("part", [0.02, 0.1, 0.5, 0.97, 1.0])
def test_bins_agree_with_sorted_times(samples: int, part: float) -> None:
    rng = np.random.default_rng(samples)
    for _ in range(20):
        times = rng.gamma(4.0, 0.2, samples) + rng.uniform(0, 1)
        times[rng.random(samples) >= part] = inf
        by_order, by_bins, first = both(times)
        met = times[times < inf]
        width = np.ptp(met) / BINS if len(met) else 0.0
        assert by_bins[PROBABILITY] == pytest.approx(by_order[PROBABILITY], abs=1e-12)
        assert first == times.min()
        if by_order[LATEST] < inf:
            assert by_order[LATEST] - 1e-12 <= by_bins[LATEST] <= by_order[LATEST] + width + 1e-12
        else:
            assert by_bins[LATEST] == inf
        if by_bins[EARLIEST] == NOT_FOUND:
            weights = LATTICE.weights[:samples]
            assert weights[times < by_order[EARLIEST]].sum() <= 2.0 * weights[times < inf].mean()
        elif len(met):
            # as few impacts come before it as before that of the sorted times, but for one bin
            assert met.min() <= by_bins[EARLIEST] <= met.max()
            weights = LATTICE.weights[:samples]
            before = [weights[times < answer[EARLIEST]].sum() for answer in (by_bins, by_order)]
            assert before[0] <= before[1] + weights.max()
            assert before[0] >= before[1] - weights[abs(times - by_bins[EARLIEST]) <= width].sum() - weights.max()
        if len(met):
            low, high = met.min(), met.max()
            assert low <= by_bins[MOST_LIKELY] <= high


def test_the_densest_half_is_that_of_the_sorted_times() -> None:
    times = np.concatenate([np.linspace(1.0, 1.2, 300), np.linspace(1.2, 3.0, 212)])
    by_order, by_bins, _ = both(np.random.default_rng(0).permutation(times))
    assert by_bins[MOST_LIKELY] == pytest.approx(by_order[MOST_LIKELY], abs=0.05)


def test_equal_times_and_none() -> None:
    _, answer, first = both(np.full(512, 0.7))
    np.testing.assert_array_equal(answer, [0.7, 0.7, 0.7, 1.0])
    assert first == 0.7
    _, answer, first = both(np.full(128, inf))
    np.testing.assert_array_equal(answer, [inf, inf, inf, 0.0])
    assert first == inf
    _, answer, _ = both(np.where(np.arange(128) == 5, 0.25, inf))
    assert answer[EARLIEST] == NOT_FOUND
    assert answer[MOST_LIKELY] == 0.25


def test_parts_of_even_samples_deviate_less_than_those_of_independent_ones() -> None:
    """The part beyond a plane in the space of the first six errors, against that of the normal distribution."""
    rng, points = np.random.default_rng(0), LATTICE.points[:6, : LATTICE.pilot].copy()
    points[0] /= WIDENED
    for dimensions in (1, 2, 3, 6):
        n = np.zeros((20_000, 6))
        n[:, :dimensions] = rng.normal(size=(20_000, dimensions))
        n /= np.linalg.norm(n, axis=1)[:, None]
        part = (n @ points < -1.6448536269514729).mean(axis=1)
        assert np.sqrt(np.mean((part - 0.05) ** 2)) < EVENLY_OUTWARD / OUTWARD * np.sqrt(0.05 * 0.95 / LATTICE.pilot)
