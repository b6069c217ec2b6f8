"""Checks of a user's arguments; numbers become float and int, because other types would compile the kernels anew."""

from __future__ import annotations

import math
import operator
from typing import Any

from collision_monitor.errors import InputError


def finite_number(name: str, value: Any, positive: bool = False) -> float:
    """Return a finite float >= 0, or > 0 if `positive`. Raises InputError."""
    try:
        result = float(value)
    except (TypeError, ValueError, OverflowError):
        result = math.nan
    if not (math.isfinite(result) and (result > 0.0 if positive else result >= 0.0)):
        bounds = "above 0" if positive else "at least 0"
        raise InputError(f"{name}: expected a finite number, {bounds}, got {value!r}")
    return result


def whole_number(name: str, value: Any) -> int:
    """Return a whole number >= 1, limited to 2^31. Raises InputError."""
    try:
        result = operator.index(value)
    except TypeError:
        result = 0
    if result < 1:
        raise InputError(f"{name}: expected a whole number from 1, got {value!r}")
    return min(result, 2**31)
