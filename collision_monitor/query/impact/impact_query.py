"""What a user asks of a time of impact, checked."""

from __future__ import annotations

from functools import lru_cache
from typing import Any, Final, NamedTuple

from collision_monitor.checks.numbers import checked_number, checked_whole

ITERATIONS: Final = 1000
"""Default limit of distance queries for one pair of pieces; hardly any pair needs more than 20."""


class MotionQuery(NamedTuple):
    """Parameters of the search for the first time at which two moving shapes are within the separation."""

    horizon: float  # s
    tolerance: float  # m
    separation: float  # m
    iterations: int  # limit of distance queries for a pair of convex pieces


def check_query(horizon: float, tolerance: float, separation: float, iterations: int) -> MotionQuery:
    """Check the parameters of the query. Raises InputError."""
    try:
        return _checked(horizon, tolerance, separation, iterations)
    except TypeError:  # of what has no hash
        return _checked.__wrapped__(horizon, tolerance, separation, iterations)


@lru_cache(maxsize=16, typed=True)
def _checked(horizon: Any, tolerance: Any, separation: Any, iterations: Any) -> MotionQuery:
    return MotionQuery(
        horizon=checked_number(horizon, "horizon", least=0.0),
        tolerance=checked_number(tolerance, "tolerance", least=0.0, above=True),
        separation=checked_number(separation, "separation", least=0.0),
        iterations=checked_whole(iterations, "iterations"),
    )
