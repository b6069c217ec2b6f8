"""Order of the times of samples: a bucket sort, which takes a tenth of the time of np.argsort for 1,000 times."""

from __future__ import annotations

from math import inf

import numpy as np

from collision_monitor._jit import device


@device
def sort_times(times, order, bucket, ends):
    """Write indices into order (n,) that sort times (n,) >= 0; infinite ones last, equal ones by index.

    bucket (n,) int64, ends (n + 1,) int64: scratch. Even buckets, then insertion within them. Returns the number of
    finite times.
    """
    size = times.size
    low, high, finite = inf, 0.0, 0
    for k in range(size):
        if times[k] < inf:
            low, high, finite = min(low, times[k]), max(high, times[k]), finite + 1
    scale = (size - 1) / (high - low) if high > low else 0.0
    if not scale < inf:
        scale = 0.0
    for k in range(size + 1):
        ends[k] = 0
    for k in range(size):
        bucket[k] = np.int64((times[k] - low) * scale) if times[k] < inf else size
        ends[bucket[k]] += 1
    total = 0
    for k in range(size + 1):
        total, ends[k] = total + ends[k], total
    for k in range(size):
        b = bucket[k]
        order[ends[b]] = k
        ends[b] += 1
    for k in range(1, finite):
        index = order[k]
        t = times[index]
        at = k
        while at > 0 and times[order[at - 1]] > t:
            order[at] = order[at - 1]
            at -= 1
        order[at] = index
    return finite
