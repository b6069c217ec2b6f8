"""Headings of paths whose poses have no orientations."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


def headings_along(position: Floats) -> Floats:
    """Quaternions (N, 4) with x along the way in the plane; the last as the one before, and so where it only climbs."""
    steps = np.diff(position[:, :2], axis=0)
    steps = np.concatenate([steps, steps[-1:]])
    moves = np.linalg.norm(steps, axis=1) > 0.0
    last = np.maximum.accumulate(np.where(moves, np.arange(len(steps)), 0))
    half = 0.5 * np.arctan2(steps[last, 1], steps[last, 0])
    return np.column_stack([np.zeros((len(half), 2)), np.sin(half), np.cos(half)])
