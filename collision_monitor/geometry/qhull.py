"""Convex hulls by Qhull. SciPy is imported at the first call: it would take a sixth of every start without one."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray


def qhull(points: NDArray[np.float64]) -> Any | None:
    """The hull of points (n, d) as scipy.spatial.ConvexHull, or None where they are flat: Qhull gives up on those."""
    from scipy.spatial import ConvexHull, QhullError

    try:
        return ConvexHull(points)
    except QhullError:
        return None
