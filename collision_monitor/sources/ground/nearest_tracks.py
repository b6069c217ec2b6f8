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
blocks in space, across which no pair is made."""


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
    found = [
        _assigned_block(detections, tracks, rows, some, gate)
        for rows, some in _blocks(detections, tracks, np.flatnonzero(near), columns)
    ]
    return np.concatenate([rows for rows, _ in found]), np.concatenate([some for _, some in found])


def _assigned_block(
    detections: Floats, tracks: Floats, rows: Rows, columns: Rows, gate: float
) -> tuple[Rows, Rows]:
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
        points = np.concatenate([detections[rows], tracks[columns]])
        axis = int(np.ptp(points, axis=0).argmax())
        by_rows = rows[np.argsort(detections[rows, axis], kind="stable")]
        by_columns = columns[np.argsort(tracks[columns, axis], kind="stable")]
        if len(rows) >= len(columns):
            cut = len(rows) // 2
            at = int(np.searchsorted(tracks[by_columns, axis], detections[by_rows[cut], axis]))
            at = at if detections[by_rows[0], axis] < detections[by_rows[-1], axis] else len(columns) // 2
            waiting += [(by_rows[:cut], by_columns[:at]), (by_rows[cut:], by_columns[at:])]
        else:
            cut = len(columns) // 2
            at = int(np.searchsorted(detections[by_rows, axis], tracks[by_columns[cut], axis]))
            at = at if tracks[by_columns[0], axis] < tracks[by_columns[-1], axis] else len(rows) // 2
            waiting += [(by_rows[:at], by_columns[:cut]), (by_rows[at:], by_columns[cut:])]
    return found
