"""Distribution of the time of impact: published times and probability from the times of weighted samples."""

from __future__ import annotations

from math import inf, sqrt
from typing import Any, Final

from collision_monitor._jit import device

EARLIEST: Final = 0


MOST_LIKELY: Final = 1


LATEST: Final = 2


PROBABILITY: Final = 3


OUTWARD: Final = 2.0
"""Standard errors by which the earliest and the latest time lie outside of the quantiles of the samples."""

EVENLY_OUTWARD: Final = 1.5
"""The same for samples of equal weight: a part of them that up to six errors select deviates by 0.7 standard errors."""


@device
def summarise(times: Any, weights: Any, order: Any, confidence: float, safe: float, answer: Any, whole: float) -> None:
    """Write earliest, most likely and latest time (s) and probability into answer (4,).

    times (n,): inf: no impact; weights (n,) with the sum `whole`; order (n,): sorts the times; safe: a time before
    which hardly any impact lies. At most 1 - confidence of the impacts lie before `earliest`, which is at most `safe`
    if too few samples meet. Both quantiles are moved outward by OUTWARD standard errors, because the samples are few.
    """
    n = 0
    total = squares = all_squares = 0.0
    for k in range(order.size):
        w = weights[order[k]] / whole
        all_squares += w * w
        if times[order[k]] < inf:
            total += w
            squares += w * w
            n += 1
    answer[PROBABILITY] = min(total, 1.0)
    answer[EARLIEST] = answer[MOST_LIKELY] = answer[LATEST] = inf
    if n == 0:
        return
    doubt = 1.0 - confidence
    variance = doubt * confidence
    few = total * (doubt - OUTWARD * sqrt(variance * squares) / total)
    answer[EARLIEST] = min(safe, times[order[0]])
    below = 0.0
    for k in range(n):
        below += weights[order[k]] / whole
        if below > few:
            break
        answer[EARLIEST] = times[order[k]]
    most = confidence + OUTWARD * sqrt(variance * all_squares)
    below = 0.0
    for k in range(n):
        below += weights[order[k]] / whole
        if below >= most:
            answer[LATEST] = times[order[k]]
            break
    # the shortest interval that contains half of the impacts
    low = 0
    inside = 0.0
    shortest = inf
    for high in range(n):
        inside += weights[order[high]] / whole
        while low < high and inside - weights[order[low]] / whole >= 0.5 * total:
            inside -= weights[order[low]] / whole
            low += 1
        length = times[order[high]] - times[order[low]]
        if inside >= 0.5 * total and length < shortest:
            shortest = length
            answer[MOST_LIKELY] = 0.5 * (times[order[high]] + times[order[low]])
