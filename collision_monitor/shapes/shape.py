"""The base class of all shapes, and the checks of their numbers."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
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


def array_bytes(shape: Shape) -> int:
    """Bytes of the arrays of a shape: its points and faces."""
    return sum(value.nbytes for value in vars(shape).values() if isinstance(value, np.ndarray))


def positive(value: float, what: str, *, or_zero: bool = False) -> float:
    """Return a positive number of metres. Raises ShapeError."""
    expected = f"{'0 or ' if or_zero else ''}a positive number of metres up to {LARGEST_INPUT:g}"
    try:
        number = real_number(value)
    except (TypeError, ValueError, OverflowError):
        raise ShapeError(f"{what}: expected {expected}, got {value!r}") from None
    if not (0.0 < number <= LARGEST_INPUT or (or_zero and number == 0.0)):
        raise ShapeError(f"{what}: expected {expected}, got {number!r}")
    return number


def set_positive(shape: Shape, names: Sequence[str]) -> None:
    """Check that these fields of a new shape are positive numbers of metres, and make them float. Raises ShapeError."""
    for name in names:
        what = f"{type(shape).__name__} {name.replace('_', ' ')}"
        object.__setattr__(shape, name, positive(getattr(shape, name), what))


def full_extents(value: Any, what: str, example: str) -> tuple[float, float, float]:
    """Return three full extents in metres, not all zero. Raises ShapeError."""
    try:
        size = tuple(map(real_number, value if type(value) in (tuple, list) else real_array(value).tolist()))
    except (TypeError, ValueError, OverflowError):
        raise ShapeError(f"{what}: expected 3 full extents in m, as {example}, got {value!r}") from None
    if len(size) != 3 or not all(0.0 <= s <= LARGEST_INPUT for s in size) or max(size) == 0.0:
        raise ShapeError(f"{what}: expected 3 extents from 0 to {LARGEST_INPUT:g}, not all zero, got {size}")
    return size[0], size[1], size[2]


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
