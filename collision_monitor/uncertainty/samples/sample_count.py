"""Number of samples that a pair needs, from the times of those of the pilot."""

from __future__ import annotations

from math import inf
from typing import Any, Final

from collision_monitor._jit import device, inlined
from collision_monitor.uncertainty.samples.normal_samples import BASE

PILOT_PART: Final = 0.3
"""A pair of shapes that is stated to pass is left out if it meets in the pilot with less than this fraction of
min_probability."""

RARE: Final = 0.03
"""Part of the pilot that does not meet below which half of the samples suffice: the error of the probability falls with
it."""


@inlined
def latest(times: Any, count: int) -> float:
    """Latest of the first `count` times (s); infinite if one of the samples does not meet."""
    last = 0.0
    for n in range(count):
        last = times[n] if times[n] > last else last
    return last


@device
def samples_needed(times: Any, columns: Any, sampling: Any, careful: bool) -> int:
    """Number of samples for bodies with these times (S,) of the pilot's samples; infinite: they do not meet.

    0: the bodies are stated to pass, and hardly meet in the pilot. BASE: they meet in all of it.
    careful: take all samples also if nearly all of the pilot meets.
    """
    weights, pilot = columns.weights, columns.pilot
    seen = part = 0.0
    for n in range(pilot):
        seen += weights[n] if times[n] < inf else 0.0
        part += weights[n]
    if seen < part * PILOT_PART * sampling.min_probability and not sampling.stated:
        return 0
    if latest(times, pilot) < inf:
        return min(BASE, weights.size)
    return max(pilot, weights.size // 2) if part - seen < RARE * part and not careful else weights.size
