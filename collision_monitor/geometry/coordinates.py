"""Input check of the geometry functions: finite arrays of the expected shape, or an error that names the array."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from collision_monitor.errors import InputError, ShapeError

Array = NDArray[np.float64]
Booleans = NDArray[np.bool_]
Indices = NDArray[np.int64]
Signs = NDArray[np.int8]


_KINDS = "biuf"
"""Kinds of NumPy's types whose values are numbers. Others convert too, but lose a part (complex) or a unit (times)."""


def real_array(value: Any) -> Array:
    """Return the numbers of an array, a list or the like as float64; a copy only if it has to be one.

    Raises TypeError, ValueError or OverflowError for anything else: also for complex numbers, texts and times, and for
    a masked array that hides some of its numbers, which NumPy would convert in silence.
    """
    if type(value) is np.ndarray and value.dtype == np.float64:
        return value
    parts = value if isinstance(value, list | tuple) else (value,)
    if any(map(hides_some, parts)):
        raise TypeError("numbers are masked")
    array = np.asarray(value)
    if array.dtype.kind == "O" and not any(isinstance(each, str | bytes | complex) for each in array.flat):
        return array.astype(np.float64)  # Fraction, Decimal and the like
    if array.dtype.kind not in _KINDS:
        raise TypeError(f"expected numbers, got {array.dtype}")
    return np.asarray(array, np.float64)


def hides_some(value: Any) -> bool:
    """Whether a value is a masked array that hides some of its elements."""
    if not isinstance(value, np.ma.MaskedArray):
        return False
    return bool(np.ascontiguousarray(np.ma.getmaskarray(value)).view(np.bool_).any())


def given_array(value: Any, what: str) -> Array:
    """Return the numbers of an array as `real_array` does. Raises InputError."""
    try:
        return real_array(value)
    except (TypeError, ValueError, OverflowError):
        raise InputError(f"{what}: expected an array of numbers, got {type(value).__name__}") from None


def real_number(value: Any) -> float:
    """Return one number. Raises TypeError, ValueError or OverflowError for anything else, as `real_array` does."""
    kind = type(value)
    if kind is float or kind is int or kind is np.float64:
        return float(value)
    return float(real_array(value))


def coordinates(value: ArrayLike, what: str, *widths: int) -> Array:
    """Points or vectors (..., width), at least one, with a width of `widths` (default 2 or 3). Raises InputError."""
    widths = widths or (2, 3)
    try:
        array = real_array(value)
    except (TypeError, ValueError, OverflowError):
        raise InputError(f"{what}: expected numbers, got {value!r:.100}") from None
    if array.ndim == 0 or array.shape[-1] not in widths or array.size == 0:
        shapes = " or ".join(f"(..., {width})" for width in widths)
        raise InputError(f"{what}: expected at least one point, shape {shapes}, got shape {array.shape}")
    if not np.isfinite(array).all():
        raise InputError(f"{what}: expected finite coordinates, got NaN or infinity")
    return array


def checked_numbers(value: ArrayLike, what: str, least: float = -np.inf) -> Array:
    """Finite numbers (...) >= `least`. Raises InputError."""
    try:
        array = real_array(value)
    except (TypeError, ValueError, OverflowError):
        raise InputError(f"{what}: expected numbers, got {value!r:.100}") from None
    if not np.isfinite(array).all() or (array < least).any():
        bound = f" >= {least:g}" if least > -np.inf else ""
        raise InputError(f"{what}: expected finite numbers{bound}, got {value!r:.100}")
    return array


def point_set(value: ArrayLike, what: str, *widths: int, least: int = 1) -> Array:
    """A set of at least `least` points (n, width). Raises ShapeError."""
    try:
        points = coordinates(value, what, *widths)
    except InputError as error:
        raise ShapeError(str(error)) from None
    if points.ndim != 2 or len(points) < least:
        raise ShapeError(f"{what}: expected at least {least} points, shape (n, {points.shape[-1]}), got {points.shape}")
    return points


def triangles(vertices: ArrayLike, faces: ArrayLike, what: str = "mesh") -> tuple[Array, Indices]:
    """A triangle mesh: vertices (n, 3), faces (m, 3) of vertex indices, m >= 1. Raises ShapeError."""
    points = point_set(vertices, f"{what} vertices", 3, least=3)
    try:
        indices = np.asarray(faces)
        if hides_some(faces):
            raise TypeError
    except (TypeError, ValueError, OverflowError):
        raise ShapeError(f"{what} faces: expected integers of shape (m, 3), got {type(faces).__name__}") from None
    if indices.ndim != 2 or indices.shape[1] != 3 or len(indices) == 0 or not np.issubdtype(indices.dtype, np.integer):
        got = f"{indices.dtype} {indices.shape}"
        raise ShapeError(f"{what} faces: expected integers of shape (m, 3), m >= 1, got {got}")
    if indices.min() < 0 or indices.max() >= len(points):
        raise ShapeError(
            f"{what} faces: expected indices from 0 to {len(points) - 1}, got {indices.min()} to {indices.max()}"
        )
    return points, indices.astype(np.int64)
