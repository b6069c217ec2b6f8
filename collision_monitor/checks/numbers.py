"""Checks of numbers and of arrays of numbers. They become float64, because other types would compile kernels anew.

An error names the argument, what was expected with unit and range, and what was there.
"""

from __future__ import annotations

import math
import operator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from collision_monitor.errors import CollisionMonitorError, InputError

Array = NDArray[np.float64]
Error = type[CollisionMonitorError]

MOST_WHOLE = 2**31
"""Larger whole numbers become this one: none of what they count, such as iterations, goes that far."""


_NUMBERS = "biuf"
"""Kinds of NumPy's types whose values are numbers. Others convert too, but lose a part (complex) or a unit (times)."""


def real_array(value: Any) -> Array:
    """Return the numbers of an array, a list or the like as float64; a copy only if it has to be one.

    Raises TypeError, ValueError or OverflowError for anything else: also for complex numbers, texts and times, and for
    a masked array that hides some of its numbers, which NumPy would convert in silence.
    """
    if type(value) is np.ndarray and value.dtype == np.float64:
        return value
    if hides_some(value):
        raise TypeError("numbers are masked")
    array = np.asarray(value)
    if array.dtype.kind == "O" and all(map(_is_like_a_number, array.flat)):
        return array.astype(np.float64)  # Fraction, Decimal and the like
    if array.dtype.kind not in _NUMBERS:
        raise TypeError(f"expected numbers, got {array.dtype}")
    with np.errstate(over="ignore"):  # a number beyond float64 becomes infinite
        return np.asarray(array, np.float64)


def _is_like_a_number(value: Any) -> bool:
    """Whether an object may be a number: no text, no complex number, and no time, which NumPy would convert too."""
    if isinstance(value, np.generic):
        return value.dtype.kind in _NUMBERS
    return not isinstance(value, str | bytes | complex)


def hides_some(value: Any) -> bool:
    """Whether a value is a masked array that hides some of its elements, or a list of such, of lists too."""
    if isinstance(value, np.ma.MaskedArray):
        return bool(np.ascontiguousarray(np.ma.getmaskarray(value)).view(np.bool_).any())
    if not isinstance(value, list | tuple) or not value:
        return False
    if isinstance(value[0], list | tuple):  # rows of plain numbers are most of what comes
        return any(hides_some(row) for row in value if row is not value and not _begins_plainly(row))
    return any(isinstance(each, np.ma.MaskedArray) and hides_some(each) for each in value)


def _begins_plainly(row: Any) -> bool:
    return isinstance(row, list | tuple) and len(row) > 0 and type(row[0]) in (float, int)


def real_number(value: Any) -> float:
    """Return one number. Raises TypeError, ValueError or OverflowError for anything else, as `real_array` does."""
    kind = type(value)
    if kind is float or kind is int or kind is np.float64:
        return float(value)
    return float(real_array(value))


def checked_number(
    value: Any,
    what: str,
    unit: str = "",
    *,
    least: float = -math.inf,
    most: float = math.inf,
    above: bool = False,
    error: Error = InputError,
) -> float:
    """Return a finite number from `least` to `most`, larger than `least` if `above`. Raises `error`."""
    try:
        number = real_number(value)
    except (TypeError, ValueError, OverflowError):
        number = math.nan
    if not (math.isfinite(number) and least <= number <= most and not (above and number == least)):
        shown = value.item() if isinstance(value, np.generic) else value  # `nan` in place of `np.float64(nan)`
        raise error(f"{what}: expected {_wanted(unit, least, most, above)}, got {shown!r:.100}")
    return number


def checked_yaml_number(
    value: Any, what: str, unit: str, *, least: float = 0.0, most: float = 1e9, error: Error = InputError
) -> float:
    """As `checked_number`, of what a YAML or JSON file holds: a text is no number there, and neither is `true`."""
    is_number = isinstance(value, int | float) and not isinstance(value, bool)
    if not (is_number and least <= value <= most):
        raise error(f"{what}: expected {_wanted(unit, least, most, False)}, got {value!r:.100}")
    return float(value)


def _wanted(unit: str, least: float, most: float, above: bool) -> str:
    """What is expected, such as `a number of m from 0 to 10`."""
    of_unit = f" of {unit}" if unit else ""
    if above:
        up_to = f" up to {most:g}" if most < math.inf else ""
        return f"a finite number{of_unit}, above {least:g}{up_to}"
    if least > -math.inf and most < math.inf:
        return f"a number{of_unit} from {least:g} to {most:g}"
    return f"a finite number{of_unit}" + (f", at least {least:g}" if least > -math.inf else "")


def checked_whole(value: Any, what: str) -> int:
    """Return a whole number >= 1, limited to MOST_WHOLE. Raises InputError."""
    try:
        number = operator.index(value)
    except TypeError:
        number = 0
    if number < 1:
        raise InputError(f"{what}: expected a whole number from 1, got {value!r:.100}")
    return min(number, MOST_WHOLE)


def as_numbers(value: Any, what: str, expected: str = "numbers", error: Error = InputError) -> Array:
    """Return a float64 array (...), which may share memory with `value`. Raises `error` for what is no such array."""
    try:
        return real_array(value)
    except (TypeError, ValueError, OverflowError):
        raise error(f"{what}: expected {expected}, got {value!r:.100}") from None


def checked_array(value: Any, what: str, *, least: float = -math.inf, error: Error = InputError) -> Array:
    """Return an array (...) of finite numbers of at least `least`. Raises `error`."""
    array = as_numbers(value, what, error=error)
    if not np.isfinite(array).all() or (array < least).any():
        bound = f" >= {least:g}" if least > -math.inf else ""
        raise error(f"{what}: expected finite numbers{bound}, got {value!r:.100}")
    return array


def checked_rows(value: Any, width: int, what: str, most: float, error: Error = InputError) -> Array:
    """Return a copy of an array (N, width); one row may lack its dimension. Raises InputError.

    most: largest number. Raises `error` for larger ones and for those that are not finite.
    """
    rows = np.atleast_2d(np.array(as_numbers(value, what, f"numbers (N, {width})")))
    if rows.ndim != 2 or rows.shape[1] != width:
        raise InputError(f"{what}: expected an array (N, {width}), got shape {np.shape(value)}")
    bad = np.flatnonzero(~(np.abs(rows) <= most).all(axis=1))
    if len(bad):
        raise error(f"{what}: expected finite numbers up to {most:g}, got others in row {bad[0]}")
    return np.ascontiguousarray(rows)
