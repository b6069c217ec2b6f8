"""A time of impact by sampling E(p), against the crossing of a plane and of a circle in closed form."""

from __future__ import annotations

from functools import partial

import numpy as np
import pytest

from collision_monitor.errors import InputError
from collision_monitor.geometry.lecture.circle import implicit_circle
from collision_monitor.geometry.lecture.sampled_impact import MOST_SAMPLES, sampled_impact
from collision_monitor.geometry.points import crossing_time, plane, signed_distance

FLOOR = plane((0, 0, 1), (0, 0, 0))


@pytest.mark.parametrize("samples", [1, 2, 7, 100, MOST_SAMPLES])
def test_of_a_plane_the_nearest_sample_counts(samples: int) -> None:
    """E is linear along the path, so the sample with the least E is the nearest in time."""
    rng = np.random.default_rng(samples)
    start, end = rng.uniform(0.1, 2, (30, 3)), rng.uniform(-2, 2, (30, 3))
    found = sampled_impact(start, end, partial(signed_distance, to=FLOOR), samples)
    exact = crossing_time(start, end, FLOOR)
    np.testing.assert_array_equal(np.isnan(found.time), np.isnan(exact))
    some = ~np.isnan(exact)
    assert some.any() and not some.all()
    assert found.spacing == 1 / samples
    assert np.abs(found.time - exact)[some].max() <= 0.5 * found.spacing + 1e-12
    np.testing.assert_allclose(found.point, start + np.nan_to_num(found.time)[:, None] * (end - start), atol=1e-12)
    np.testing.assert_allclose(found.value[some], found.point[some, 2])


def test_more_samples_are_more_accurate_and_find_the_first_crossing() -> None:
    """A path through a circle meets it at 0.25 first, and leaves it at 0.75."""
    circle = partial(implicit_circle, center=(0, 0), radius=1.0)
    for samples in (10, 100, 1000):
        found = sampled_impact((-2, 0), (2, 0), circle, samples)
        assert abs(found.time - 0.25) <= 1 / samples
    assert np.isnan(sampled_impact((-2, 0), (2, 0), circle, 1).time)  # both ends are outside: it is missed
    assert np.isnan(sampled_impact((-2, 1.5), (2, 1.5), circle, 1000).time)
    inside = sampled_impact((0.5, 0), (2, 0), circle, 10)
    assert inside.time == 0.0 and inside.value < 0.0  # overlapping already


def test_a_point_that_ends_on_the_boundary_meets_it_there() -> None:
    found = sampled_impact((0.0, 0.0, 0.3), (0.1, 0.2, 0.0), partial(signed_distance, to=FLOOR), 3)
    assert found.time == 1.0 and found.point.tolist() == [0.1, 0.2, 0.0] and found.value == 0.0


def test_wrong_arguments_are_refused() -> None:
    for samples in (0, MOST_SAMPLES + 1, 2.5, True, "3"):
        with pytest.raises(InputError, match="samples"):
            sampled_impact((0, 0), (1, 1), lambda p: p[..., 0], samples)  # type: ignore[arg-type]
    with pytest.raises(InputError, match=r"equation: expected values of shape \(33,\), got \(33, 2\)"):
        sampled_impact((0, 0), (1, 1), lambda p: p)
    with pytest.raises(InputError, match="at most"):
        sampled_impact(np.zeros((10_000, 3)), np.ones(3), lambda p: p[..., 0], 1000)
    with pytest.raises(InputError, match="broadcast"):
        sampled_impact(np.zeros((3, 2)), np.ones((2, 2)), lambda p: p[..., 0])
