"""Sweep and prune: boxes are sorted along one axis, and each is compared with those that begin before it ends.

(Baraff, 1992; Cohen, Lin, Manocha and Ponamgi, I-COLLIDE, 1995)
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from collision_monitor.broad_phase.boxes import Indices, box_arrays, in_order, overlaps_in_ranges


def sweep_and_prune(lower: ArrayLike, upper: ArrayLike) -> Indices:
    """Pairs (M, 2), i < j, sorted, of boxes (N, 2 or 3) that overlap or touch; sweeps the axis of largest spread.

    Raises InputError.
    """
    low, high = box_arrays(lower, upper)
    axis = int(np.std(low + high, axis=0).argmax()) if len(low) else 0
    order = np.argsort(low[:, axis], kind="stable")
    low, high = low[order], high[order]
    place = np.arange(len(low))
    end = np.searchsorted(low[:, axis], high[:, axis], side="right")
    return in_order(order[overlaps_in_ranges(low, high, place, place + 1, end - place - 1)])
