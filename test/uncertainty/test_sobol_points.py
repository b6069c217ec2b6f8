"""The scrambled Sobol' points: against SciPy's sequence, and how evenly the samples lie in all directions."""

from __future__ import annotations

from statistics import NormalDist

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.stats import qmc

from collision_monitor.uncertainty.samples.normal_samples import DIMENSIONS, normal_samples
from collision_monitor.uncertainty.samples.sobol_points import scrambled, sobol_digits


def test_the_sequence_is_that_of_scipy() -> None:
    """SciPy orders the points by Gray codes."""
    digits, count = 12, 4096
    index = np.arange(count)
    points = sobol_digits(count, DIMENSIONS, digits)[index ^ (index >> 1)] / 2.0**digits
    np.testing.assert_array_equal(points, qmc.Sobol(DIMENSIONS, scramble=False).random(count))


def test_scrambling_keeps_the_points_even() -> None:
    """Each of the 2^m cells of a coordinate has one of the first 2^m points; so have all boxes of two coordinates
    that the sequence fills evenly."""
    digits = 10
    plain = sobol_digits(1024, DIMENSIONS, digits)
    mixed = scrambled(plain, digits)
    assert (plain != mixed).mean() > 0.9
    for m in range(1, digits + 1):
        cells = mixed[: 2**m] >> np.uint64(digits - m)
        assert all(len(np.unique(column)) == 2**m for column in cells.T)
    for i, j in ((0, 1), (1, 2), (6, 7), (7, 8), (9, 11)):
        for m in range(1, digits):
            for k in range(m + 1):
                counts = [
                    np.unique((points[:, i] >> np.uint64(digits - k)) << np.uint64(m - k) | points[:, j] >> np.uint64(
                        digits - (m - k)), return_counts=True)[1]
                    for points in (plain, mixed)
                ]  # fmt: skip
                assert sorted(counts[0]) == sorted(counts[1])


def directions(columns: list[int], count: int) -> NDArray[np.float64]:
    """Random unit vectors (count, DIMENSIONS) in the space of some coordinates."""
    along = np.zeros((count, DIMENSIONS))
    along[:, columns] = np.random.default_rng(1).normal(size=(count, len(columns)))
    return along / np.linalg.norm(along, axis=1, keepdims=True)


@pytest.mark.parametrize("columns", [[6, 7, 8], [9, 10, 11], [12, 13, 14], [0, 1, 6, 7, 8], list(range(DIMENSIONS))])
@pytest.mark.parametrize(("samples", "rms", "worst"), [(1024, 0.011, 0.07), (256, 0.022, 0.14), (128, 0.032, 0.2)])
def test_half_spaces_have_their_probability(columns: list[int], samples: int, rms: float, worst: float) -> None:
    """Along any direction, as of an error of orientation about an oblique axis. The first of 1024 samples are as even
    as samples of their own. `worst` is about that of two half-spaces."""
    for whole in (1024, samples):
        points, weights = (part[:samples] for part in normal_samples(whole))
        along, weights = points @ directions(columns, 100).T, weights / weights.sum()
        off = []
        for edge in (0.3, 0.7, 1.0, 1.5, 2.0):
            true = NormalDist().cdf(-edge)
            off += [weights @ (along > edge) - true, weights @ (along < -edge) - true]
            off.append(off[-1] + off[-2])
        assert np.sqrt(np.mean(np.square(off))) < rms
        assert np.abs(off).max() < worst
