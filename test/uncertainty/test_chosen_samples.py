"""The samples that are chosen for a pair, against all samples."""

from __future__ import annotations

from math import inf

import numpy as np
import pytest
from numpy.typing import NDArray

from collision_monitor.impact.body_impact import ImpactQuery
from collision_monitor.uncertainty.plane_memory import ChosenSamples, make_plane_memory
from collision_monitor.uncertainty.sampled_impacts import Sampling
from collision_monitor.uncertainty.samples.chosen_samples import choose_samples
from collision_monitor.uncertainty.samples.normal_samples import (
    BASE,
    DIMENSIONS,
    SampleColumns,
    normal_samples,
    sample_columns,
)

COUNT = 1024
COLUMNS = sample_columns(COUNT)


def chosen(meets: NDArray[np.bool_], *, careful: bool = False, columns: SampleColumns = COLUMNS) -> ChosenSamples:
    """The samples that are chosen if these of all meet (n,)."""
    count = len(columns.weights)
    sampling = Sampling(
        ImpactQuery(0.0, 1e-3, 50), 2.0, 0.0, False, 3.0, 4.0, 0.01, 0.95, False, *normal_samples(count)
    )  # fmt: skip
    memory = make_plane_memory(count).chosen
    n = choose_samples(np.where(meets, 1.0, inf), columns, DIMENSIONS, sampling, careful, memory)
    return ChosenSamples(memory.points[:, :n], memory.weights[:n], memory.sums[:, :n])


@pytest.mark.parametrize("threshold", [-2.0, -1.0, 0.0, 1.0, 2.0])
@pytest.mark.parametrize("slope", [0.0, 0.1, 0.5])
@pytest.mark.parametrize("both", [False, True])
def test_they_have_the_probability_of_all(threshold: float, slope: float, both: bool) -> None:
    def meets(points: NDArray[np.float64]) -> NDArray[np.bool_]:
        miss = points[0] + slope * (points[1] - points[3])
        return np.asarray((abs(miss) if both else miss) < (abs(threshold) if both else threshold))

    if both and threshold == 0.0:
        return
    found = chosen(meets(COLUMNS.points))
    whole, squares = found.sums[:, -1]
    assert whole == pytest.approx(1.0, abs=1e-12)
    assert squares == pytest.approx(np.sum(found.weights**2))
    own = np.sum(found.weights[meets(found.points)])
    assert own == pytest.approx(np.sum(COLUMNS.weights[meets(COLUMNS.points)]), abs=1e-9 if slope == 0.0 else 0.006)
    assert BASE <= len(found.weights) <= (0.8 if slope <= 0.1 else 1.0) * COUNT
    np.testing.assert_array_equal(found.points[:, : COLUMNS.pilot], COLUMNS.points[:, : COLUMNS.pilot])


def test_none_all_or_the_first_ones() -> None:
    first = COLUMNS.points[0]
    assert len(chosen(first > 10.0).weights) == 0  # nobody meets
    assert len(chosen(first < 10.0).weights) == BASE  # everybody does
    assert len(chosen(first < 0.3, careful=True).weights) == COUNT
    scattered = chosen(np.random.default_rng(0).random(COUNT) < 0.5)
    assert len(scattered.weights) == COUNT
    assert np.sum(scattered.weights) == pytest.approx(1.0)


@pytest.mark.parametrize("count", [16, 200, 300, 777])
def test_any_number_of_samples(count: int) -> None:
    columns = sample_columns(count)
    found = chosen(columns.points[0] < 0.2, columns=columns)
    assert len(found.weights) <= count
    assert np.sum(found.weights) == pytest.approx(1.0)
    assert np.sum(found.weights[found.points[0] < 0.2]) == pytest.approx(
        np.sum(columns.weights[columns.points[0] < 0.2]), abs=1e-9
    )
