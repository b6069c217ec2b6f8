"""Distribution of the time of impact from the times of weighted samples, by bins instead of by their order.

Sorting the times of a thousand samples takes longer than finding them. The published times are edges of bins, which
are rounded outward by at most 1 / BINS of the range of the times.
"""

from __future__ import annotations

from math import inf, sqrt
from typing import Any, Final

from collision_monitor._jit import device
from collision_monitor.uncertainty.impact_distribution import EARLIEST, LATEST, MOST_LIKELY, PROBABILITY

BINS: Final = 256
"""Number of bins between the first and the last impact of a sample."""

NOT_FOUND: Final = -1.0
"""In place of the earliest time: too few samples meet."""


@device
def summarise_by_bins(
    times: Any, weights: Any, sums: Any, outward: float, confidence: float, memory: Any, answer: Any
) -> float:
    """Write earliest, most likely and latest time (s) and probability into answer (4,); see `summarise`.

    times (n,): of the first samples; inf: no impact. weights, sums: see
    SampleColumns. outward: standard errors by which both quantiles are moved outward. Returns the first impact (s).
    """
    met, weight, bins = memory.spare[0], memory.spare[1], memory.bins
    hits = 0
    for n in range(times.size):  # without a branch, because no processor predicts which samples meet
        met[hits], weight[hits] = times[n], weights[n]
        hits += 1 if times[n] < inf else 0
    answer[PROBABILITY] = 0.0
    answer[EARLIEST] = answer[MOST_LIKELY] = answer[LATEST] = inf
    if hits == 0:
        return inf
    least, last = inf, 0.0
    for n in range(hits):
        least = met[n] if met[n] < least else least
        last = met[n] if met[n] > last else last
    width = (last - least) / BINS
    scale = 1.0 / width if width > 0.0 and 1.0 / width < inf else 0.0
    for k in range(BINS):
        bins[k] = 0.0
    squares = 0.0
    for n in range(hits):
        bins[int(min((met[n] - least) * scale, BINS - 1.0))] += weight[n]
        squares += weight[n] * weight[n]
    total = 0.0
    for k in range(BINS):
        total += bins[k]
        bins[k] = total
    whole, all_squares = sums[0, times.size - 1], sums[1, times.size - 1]
    variance = (1.0 - confidence) * confidence
    few = (1.0 - confidence) * total - outward * sqrt(variance * squares)
    most = confidence * whole + outward * sqrt(variance * all_squares)
    answer[PROBABILITY] = min(total / whole, 1.0)
    first = 0
    while bins[first] <= few:
        first += 1
    answer[EARLIEST] = least + first * width if few * hits >= total else NOT_FOUND
    if total >= most:
        first = 0
        while bins[first] < most:
            first += 1
        answer[LATEST] = least + (first + 1) * width
    # the shortest interval that contains half of the impacts; of equal ones that with the most
    low, shortest, densest = 0, BINS + 1, 0.0
    for high in range(BINS):
        while bins[high] - bins[low] >= 0.5 * total:
            low += 1
        inside = bins[high] - (bins[low - 1] if low > 0 else 0.0)
        length = high + 1 - low
        if inside >= 0.5 * total and (length < shortest or (length == shortest and inside > densest)):
            shortest, densest = length, inside
            answer[MOST_LIKELY] = least + 0.5 * (low + high + 1) * width
    return least
