"""How the standard deviation of a prediction grows: by errors of position, velocity and acceleration.

The variance along one axis after t s is p^2 + (v t)^2 + (a t^2 / 2)^2 for independent errors that do not change.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import nnls

Floats = NDArray[np.float64]


class ErrorGrowth(NamedTuple):
    """Standard deviations along one axis: position (m), velocity (m/s), acceleration (m/s^2)."""

    position: float
    velocity: float
    acceleration: float

    def after(self, seconds: float) -> float:
        """The standard deviation (m) after some seconds."""
        t = seconds
        return float(np.sqrt(self.position**2 + (self.velocity * t) ** 2 + (0.5 * self.acceleration * t * t) ** 2))


def fitted_growth(leads: Sequence[float], variances: Sequence[float]) -> ErrorGrowth:
    """Fit the growth to variances along one axis (m^2) after some times (s), by relative least squares."""
    t, v = np.array(leads), np.array(variances)
    weight = 1.0 / np.maximum(v, max(float(v.max()), 1e-12) * 1e-6)
    columns = np.column_stack([np.ones_like(t), t**2, 0.25 * t**4]) * weight[:, None]
    found, _ = nnls(columns, v * weight)
    return ErrorGrowth(*np.sqrt(found).tolist())
