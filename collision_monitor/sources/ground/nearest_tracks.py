"""Which detection continues which track: the assignment with the least sum of squared distances within a gate.

Candidates come from a k-d tree, and the assignment from SciPy's `linear_sum_assignment`. A track that is not continued
costs as much as one at the gate, so that no two good pairs are changed for three bad ones. Source: Blackman and Popoli,
Design and Analysis of Modern Tracking Systems (1999), 6.4, global nearest neighbour.
"""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Rows = NDArray[np.intp]

LARGEST_BLOCK: Final = 400
"""Detections, or tracks, of one assignment: 0.05 s at worst. More than that within a gate of each other are cut into
blocks in space; across their borders, only what is left is paired."""


def load_assignment() -> None:
    """Import SciPy's parts, which takes half a second, before messages arrive."""
    assigned(np.eye(3), np.eye(3), 1.0)


def assigned(detections: Floats, tracks: Floats, gate: float) -> tuple[Rows, Rows]:
    """Return the rows of detections (n, 3) and of the tracks (m, 3) that they continue, at most `gate` (m) away."""
    none = np.zeros(0, np.intp)
    if not (len(detections) and len(tracks)):
        return none, none
    from scipy.spatial import cKDTree

    near = np.isfinite(cKDTree(detections).query(tracks, distance_upper_bound=gate * (1.0 + 1e-9))[0])
    columns = np.flatnonzero(near)
    if not len(columns):
        return none, none
    near = np.isfinite(cKDTree(tracks[columns]).query(detections, distance_upper_bound=gate * (1.0 + 1e-9))[0])
    rows, i, j = np.flatnonzero(near), none, none
    for _ in range(2):  # the second time, what is left at the borders of blocks
        for block in _blocks(detections, tracks, rows, columns):
            found = _assigned_block(detections, tracks, *block, gate)
            i, j = np.concatenate([i, found[0]]), np.concatenate([j, found[1]])
        rows, columns = np.setdiff1d(rows, i), np.setdiff1d(columns, j)
    return i, j


def _assigned_block(detections: Floats, tracks: Floats, rows: Rows, columns: Rows, gate: float) -> tuple[Rows, Rows]:
    from scipy.optimize import linear_sum_assignment
    from scipy.spatial.distance import cdist

    squared = cdist(detections[rows], tracks[columns], "sqeuclidean")
    i, j = linear_sum_assignment(np.minimum(squared, gate**2))
    kept = squared[i, j] <= gate**2
    return rows[i[kept]], columns[j[kept]]


def _blocks(detections: Floats, tracks: Floats, rows: Rows, columns: Rows) -> list[tuple[Rows, Rows]]:
    """Cut detections and tracks at the middle of their longest extent, until each part is small enough."""
    waiting, found = [(rows, columns)], []
    while waiting:  # terminates: each part has at most half of the detections, or of the tracks
        rows, columns = waiting.pop()
        if max(len(rows), len(columns)) <= LARGEST_BLOCK:
            found.append((rows, columns))
            continue
        axis = int(np.ptp(np.concatenate([detections[rows], tracks[columns]]), axis=0).argmax())
        rows, columns = _sorted(detections, rows, axis), _sorted(tracks, columns, axis)
        if len(rows) >= len(columns):
            at = len(rows) // 2
            other = _cut(detections[rows, axis], at, tracks[columns, axis])
            waiting += [(rows[:at], columns[:other]), (rows[at:], columns[other:])]
        else:
            at = len(columns) // 2
            other = _cut(tracks[columns, axis], at, detections[rows, axis])
            waiting += [(rows[:other], columns[:at]), (rows[other:], columns[at:])]
    return found


def _sorted(points: Floats, rows: Rows, axis: int) -> Rows:
    """Return rows by the coordinate of an axis, and equal ones by the other two, so that two equal sets agree."""
    x = points[rows]
    return rows[np.lexsort((x[:, axis - 2], x[:, axis - 1], x[:, axis]))]


def _cut(values: Floats, at: int, others: Floats) -> int:
    """Return where sorted values are cut like the sorted others at `at`: at the same value, and the same part of it."""
    value = values[at]
    first, last = np.searchsorted(values, value, "left"), np.searchsorted(values, value, "right")
    low, high = np.searchsorted(others, value, "left"), np.searchsorted(others, value, "right")
    return int(low + round((at - first) / (last - first) * (high - low)))
