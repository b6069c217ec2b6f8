"""How far objects are off their predicted positions, and the standard deviations that say so for every look-ahead."""

from __future__ import annotations

from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import nnls

Array = NDArray[np.float64]

LAGS: Final = (0.25, 0.5, 1.0, 1.5, 2.0)
"""s: look-aheads at which deviations are measured."""

BALL: Final = 2.23606797749979
"""Radius of a ball in which a uniform distribution has a standard deviation of 1 along each axis: sqrt(5)."""


class Growth(NamedTuple):
    """Standard deviations along one axis, from which the deviation follows at every look-ahead.

    >>> Growth(3.0, 4.0, 0.0).at(1.0)
    5.0
    """

    position: float
    """m."""
    velocity: float
    """m/s."""
    acceleration: float
    """m/s^2, constant over the look-ahead."""

    @property
    def most_acceleration(self) -> float:
        """m/s^2: the bound `max_linear_acceleration` whose ball has this standard deviation."""
        return BALL * self.acceleration

    def at(self, lag: float) -> float:
        """Standard deviation along one axis (m) after `lag` s."""
        return float(np.sqrt(self.position**2 + (self.velocity * lag) ** 2 + (0.5 * self.acceleration * lag**2) ** 2))


def growth_of(variances: Array, lags: Array) -> Growth:
    """Return the growth with the best relative fit to variances (L,) along one axis (m^2) at lags (L,) (s).

    Non-negative least squares (Lawson and Hanson, Solving Least Squares Problems, 1974, chapter 23).
    """
    rows = np.stack([np.ones_like(lags), lags**2, 0.25 * lags**4], axis=1)
    known = variances > 0.0
    if not known.any():
        return Growth(0.0, 0.0, 0.0)
    fitted = nnls(rows[known] / variances[known, None], np.ones(int(known.sum())))[0]
    return Growth(*np.sqrt(fitted).tolist())
