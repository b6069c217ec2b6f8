"""The time of impact of a point by sampling: the sample of its path at which the obstacle's equation is closest to 0.

(Slide "Collision detection: time of impact": E(p) = 0 somewhere between P(t_i) and P(t_i+1); more samples cost more and
are more accurate.) `points.crossing_time` has the exact answer for a plane, `cm.time_of_impact` a certified one for
shapes.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from collision_monitor.checks.numbers import as_numbers
from collision_monitor.errors import InputError
from collision_monitor.geometry.coordinates import Array, coordinates

MOST_SAMPLES: Final = 10_000
"""Samples of a path."""

MOST_VALUES: Final = 10_000_000
"""Samples of all paths together: 240 MB."""


class SampledImpact(NamedTuple):
    """time (...): fraction of the path, 0 to 1; NaN for a path that stays outside. point (..., width) in m there.

    value (...): E there. spacing: between two samples; the first crossing that they show is within one of `time`.
    """

    time: Array
    point: Array
    value: Array
    spacing: float


def sampled_impact(
    start: ArrayLike, end: ArrayLike, equation: Callable[[Array], ArrayLike], samples: int = 32
) -> SampledImpact:
    """When points that move straight from start to end (..., 2 or 3) in m first meet the set {p : E(p) <= 0}.

    equation: E of points (..., 2 or 3), positive outside, such as `partial(implicit_circle, center=…, radius=…)`.
    samples: of each path besides its start. Of the two samples around the first change of sign, the one with E closer
    to 0 counts. A set that a path crosses between two samples is missed. Raises InputError.
    """
    if isinstance(samples, bool) or not isinstance(samples, int | np.integer) or not 1 <= samples <= MOST_SAMPLES:
        raise InputError(f"samples: expected a whole number from 1 to {MOST_SAMPLES}, got {samples!r:.80}")
    try:
        first, last = np.broadcast_arrays(coordinates(start, "start"), coordinates(end, "end"))
    except ValueError:
        raise InputError("expected starts and ends that broadcast, got others") from None
    if first.size * (samples + 1) > MOST_VALUES:
        raise InputError(f"expected at most {MOST_VALUES} coordinates of samples, got {first.size * (samples + 1)}")
    times = np.arange(samples + 1) / samples
    paths = first + times.reshape(-1, *[1] * first.ndim) * (last - first)  # (samples + 1, ..., width)
    paths[-1] = last
    values = as_numbers(equation(paths), "equation")
    if values.shape != paths.shape[:-1]:
        raise InputError(f"equation: expected values of shape {paths.shape[:-1]}, got {values.shape}")
    inside = values <= 0.0
    meets = inside.any(axis=0)
    at = inside.argmax(axis=0)  # the first sample inside
    before = np.maximum(at - 1, 0)
    value, earlier = (np.take_along_axis(values, k[None], axis=0)[0] for k in (at, before))
    at = np.where((at > 0) & (np.abs(earlier) < np.abs(value)), before, at)
    value = np.take_along_axis(values, at[None], axis=0)[0]
    point = np.take_along_axis(paths, at[None, ..., None], axis=0)[0]
    return SampledImpact(np.where(meets, times[at], np.nan), point, value, 1.0 / samples)
