"""The samples that a pair needs: beside the first ones, those whose outcome the pilot leaves open.

The first coordinate of a sample, the error along the miss, decides most. Sorted by it, the samples of the pilot meet in
one run and miss outside of it, but for some ranks at the ends of the run where other errors matter too. Other samples
beyond these ranks end as the pilot does, so that the first ones stand for them, with their weight.
"""

from __future__ import annotations

from math import inf
from typing import Any, Final

from collision_monitor._jit import device, inlined
from collision_monitor.uncertainty.samples.normal_samples import BASE
from collision_monitor.uncertainty.samples.sample_count import latest, samples_needed

SPARE: Final = 12
"""Ranks of the pilot beyond those with both outcomes that count as open too; a quarter of their number comes on top."""


@inlined
def open_ranks(times: Any, order: Any, spare: int) -> tuple[int, int, int, int]:
    """Ranks (4,) of the pilot at which both parts with both outcomes begin and end, at the ends of the longest run.

    order (pilot,): sorts the pilot's times by the first coordinate; spare: see SPARE.

    The run itself is open too if it is less than half of the pilot: its times matter, and it is small.
    """
    pilot = order.size
    run, begin, end, first, last, hits = 0, 0, 0, pilot, 0, 0
    for rank in range(pilot):
        run = run + 1 if times[order[rank]] < inf else 0
        if run > 0:
            hits, first, last = hits + 1, min(first, rank), rank + 1
        if run > end - begin:
            begin, end = rank + 1 - run, rank + 1
    before, after = spare + (begin - first) // 4, spare + (last - end) // 4
    low = max(first - before, 0) if begin > 0 else 0
    high = min(last + after, pilot) if end < pilot else pilot
    low_end = begin + before if begin > 0 else 0
    high_begin = end - after if end < pilot else pilot
    if hits == 0:
        return 0, pilot, pilot, pilot
    if 2 * hits < pilot or low_end >= high_begin:
        return low, high, high, high
    return low, low_end, high_begin, high


@inlined
def _represent(columns: Any, weights: Any, begin: int, end: int) -> None:
    """Let the first weights (BASE,) of these ranks of the pilot stand for all samples of the ranks."""
    if begin >= end:
        return
    first, order = columns.points[0], columns.order
    low = first[order[begin]] if begin > 0 else -inf
    high = first[order[end]] if end < order.size else inf
    own = 0.0
    for n in range(weights.size):
        own += weights[n] if low <= first[n] < high else 0.0
    others = columns.ranked_sums[columns.place[end]] - columns.ranked_sums[columns.place[begin]]
    factor = (own + others) / own if own > 0.0 else 1.0
    for n in range(weights.size):
        weights[n] *= factor if low <= first[n] < high else 1.0


@device
def choose_samples(times: Any, columns: Any, used: int, sampling: Any, careful: bool, chosen: Any) -> int:
    """Choose samples (ChosenSamples) for bodies with these times (S,) of the pilot; infinite: they do not meet.

    Returns their number. 0: the bodies are stated to pass, and hardly meet in the pilot. The first ones are the pilot.
    used: number of the coordinates in use; careful: choose all unless the whole pilot meets.
    """
    pilot = columns.pilot
    if samples_needed(times, columns, sampling, careful) == 0:
        return 0
    base, is_open = min(BASE, columns.weights.size), (0, pilot, pilot, pilot)
    if latest(times, pilot) < inf:
        is_open = (0, 0, pilot, pilot)
    elif not careful:
        is_open = open_ranks(times, columns.order, SPARE)
    weights = chosen.weights[0:base]
    for n in range(base):
        weights[n] = columns.weights[n]
    for row in range(used):
        source, target = columns.points[row, 0:base], chosen.points[row, 0:base]
        for n in range(base):
            target[n] = source[n]
    _represent(columns, weights, 0, is_open[0])
    _represent(columns, weights, is_open[1], is_open[2])
    _represent(columns, weights, is_open[3], pilot)
    count = base
    for zone in range(2):
        begin, end = columns.place[is_open[2 * zone]], columns.place[is_open[2 * zone + 1]]
        ranked = columns.ranked[begin:end]
        for row in range(used):
            source, target = columns.points[row], chosen.points[row, count : count + ranked.size]
            for n in range(ranked.size):
                target[n] = source[ranked[n]]
        for n in range(ranked.size):
            chosen.weights[count + n] = columns.weights[ranked[n]]
        count += ranked.size
    whole = squares = 0.0
    for n in range(count):
        whole += chosen.weights[n]
        squares += chosen.weights[n] * chosen.weights[n]
    chosen.sums[0, count - 1], chosen.sums[1, count - 1] = whole, squares
    return count
