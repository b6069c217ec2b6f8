"""Arrays in runs: so many elements for each of some things, one run after another."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

Indices = NDArray[np.int64]


def in_runs(counts: NDArray[Any]) -> tuple[Indices, Indices]:
    """Return the run of each element, and its number in it from 0 on; counts (N,): elements of each run.

    >>> in_runs(np.array([2, 0, 3]))
    (array([0, 0, 2, 2, 2]), array([0, 1, 0, 1, 2]))
    """
    run = np.repeat(np.arange(len(counts)), counts)
    return run, np.arange(len(run)) - np.repeat(np.cumsum(counts) - counts, counts)
