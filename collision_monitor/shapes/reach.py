"""Support function of objects, in NumPy: how far they extend in a direction."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from collision_monitor.shapes.pose import Pose
from collision_monitor.shapes.registry import Shape, kind_of

Array = NDArray[np.float64]


def reach(pieces: Sequence[tuple[Shape, Pose]], directions: ArrayLike) -> Array:
    """Greatest d . x (...) in m over all pieces, for unit directions d (..., 3); inf if unbounded."""
    d = np.asarray(directions, dtype=np.float64)
    each = [d @ pose.position + kind_of(shape).support(shape, d @ pose.rotation) for shape, pose in pieces]
    return np.asarray(np.max(each, axis=0))
