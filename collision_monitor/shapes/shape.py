"""The base class of all shapes, and the checks of their numbers."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields
from math import nan
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from collision_monitor.checks.numbers import real_array, real_number
from collision_monitor.errors import ShapeError
from collision_monitor.tolerances import LARGEST_INPUT

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Shape:
    """Base class of all shapes. Shapes with arrays compare by identity, the others by their sizes."""

    def __getstate__(self) -> dict[str, Any]:
        """Copies and pickles hold the fields alone, not what later calls keep on the shape."""
        return {each.name: self.__dict__[each.name] for each in fields(self)}


def array_bytes(shape: Shape) -> int:
    """Bytes of the arrays of a shape: its points and faces, or its cells."""
    return sum(value.nbytes for value in shape.__getstate__().values() if isinstance(value, np.ndarray))


def positive(value: float, what: str, *, or_zero: bool = False) -> float:
    """Return a positive number of metres. Raises ShapeError."""
    try:
        number = real_number(value)
    except (TypeError, ValueError, OverflowError):
        number = nan
    if not (0.0 < number <= LARGEST_INPUT or (or_zero and number == 0.0)):
        expected = f"{'0 or ' if or_zero else ''}a positive number of metres up to {LARGEST_INPUT:g}"
        raise ShapeError(f"{what}: expected {expected}, got {value!r}")
    return number


def set_positive(shape: Shape, names: Sequence[str]) -> None:
    """Check that these fields of a new shape are positive numbers of metres, and make them float. Raises ShapeError."""
    known = shape.__dict__
    for name in names:
        value = known[name]
        if (type(value) is float or type(value) is int) and 0.0 < value <= LARGEST_INPUT:
            known[name] = float(value)
        else:  # the text of an error takes longest
            known[name] = positive(value, f"{type(shape).__name__} {name.replace('_', ' ')}")


def full_extents(value: Any, what: str, example: str) -> tuple[float, float, float]:
    """Return three full extents in metres, not all zero. Raises ShapeError."""
    try:
        x, y, z = map(real_number, value if type(value) in (tuple, list) else real_array(value).tolist())
    except (TypeError, ValueError, OverflowError):
        raise ShapeError(f"{what}: expected 3 full extents in m, as {example}, got {value!r}") from None
    are_valid = 0.0 <= x <= LARGEST_INPUT and 0.0 <= y <= LARGEST_INPUT and 0.0 <= z <= LARGEST_INPUT
    if not (are_valid and (x, y, z) != (0.0, 0.0, 0.0)):
        raise ShapeError(f"{what}: expected 3 extents from 0 to {LARGEST_INPUT:g}, not all zero, got {(x, y, z)}")
    return x, y, z


def point_rows(value: ArrayLike, what: str, width: int, least: int) -> Array:
    """Return at least so many points (n, width) in metres, read-only. Raises ShapeError."""
    try:
        points = np.array(real_array(value))
    except (TypeError, ValueError, OverflowError):
        raise ShapeError(f"{what}: expected an array of shape (n, {width}), got {type(value).__name__}") from None
    if points.ndim != 2 or points.shape[1] != width or len(points) < least:
        raise ShapeError(f"{what}: expected at least {least} points, shape (n, {width}), got shape {points.shape}")
    if not (np.abs(points) <= LARGEST_INPUT).all():
        raise ShapeError(f"{what}: expected finite coordinates up to {LARGEST_INPUT:g}, got NaN, infinity or larger")
    points.setflags(write=False)
    return points
