"""Determinants with an exact sign, the basis of all inside, side and crossing tests.

A filter accepts the floating-point value if its relative error is certainly below 1e-13; otherwise the value is
computed again in integers. Zero therefore means exactly zero: on the line, in the plane.
(Slides "Point in convex polygon", the sided test, and "point-arbitrary plane";
Shewchuk, Adaptive precision floating-point arithmetic and fast robust geometric predicates, 1997.)
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from math import ldexp
from typing import Any, Final

import numpy as np
from numpy.typing import ArrayLike, NDArray

from collision_monitor.checks.numbers import real_array
from collision_monitor.errors import InputError, TooCostlyError
from collision_monitor.geometry.coordinates import Array

CANCELLATION: Final = 2.0**-7
"""A determinant below this part of the sum of its terms' sizes is computed again in integers.
Its round-off is at most 16 * 2^-53 of that sum (Shewchuk, 1997), so accepted values are accurate to 2.3e-13.
Larger: exact arithmetic, 10 µs each, is used where it changes nothing. Smaller: crossing points lose digits."""

UNDERFLOW: Final = 1e-290
"""Sums of products below this, relative to the factor that multiplies a product again, may have lost terms to
underflow: each product loses at most 5e-324."""

_limits: ContextVar[list[int] | None] = ContextVar("exact_limit", default=None)

LARGEST: Final = 1.7976931348623157e308
SMALLEST: Final = 5e-324
"""The largest and the smallest positive float64: values of determinants that exceed the range on either side."""


@contextmanager
def exact_limit(most: int) -> Iterator[list[int]]:
    """Allow at most this many determinants in integers within the context, 10 to 20 µs each. Yields the number left.

    Beyond it, the functions of this module raise TooCostlyError. Shapes can be made so that nearly every one is needed.
    """
    left = [most]
    token = _limits.set(left)
    try:
        yield left
    finally:
        _limits.reset(token)


def segments_cross(a: ArrayLike, b: ArrayLike, c: ArrayLike, d: ArrayLike) -> Array:
    """(b - a) x (d - c) in m² of points (..., 2): positive if d - c turns left from b - a, 0 if parallel."""
    a, b, c, d = _together(2, a, b, c, d)
    with np.errstate(over="ignore", invalid="ignore", under="ignore"):
        u, v = b - a, d - c
        left, right = u[..., 0] * v[..., 1], u[..., 1] * v[..., 0]
        value = left - right
        size = np.abs(left) + np.abs(right)
        certain = (np.abs(value) > CANCELLATION * size) & (size > UNDERFLOW)
    zero = ((u == 0.0) | (v[..., ::-1] == 0.0)).all(axis=-1)  # both products are exactly zero, not underflowed
    return _corrected(np.where(zero, 0.0, value), certain | zero, _cross_exactly, a, b, c, d)


def orient2d(a: ArrayLike, b: ArrayLike, p: ArrayLike) -> Array:
    """Twice the signed area (m²) of triangles a, b, p (..., 2): positive if p is left of the line from a to b."""
    return segments_cross(a, b, a, p)


def orient3d(a: ArrayLike, b: ArrayLike, c: ArrayLike, p: ArrayLike) -> Array:
    """Six times the signed volume (m³) of a, b, c, p (..., 3): positive if a, b, c appear counter-clockwise from p."""
    a, b, c, p = _together(3, a, b, c, p)
    with np.errstate(over="ignore", invalid="ignore", under="ignore"):
        u, v, w = b - a, c - a, p - a
        value, size = np.zeros(u.shape[:-1]), np.zeros(u.shape[:-1])
        for i, j, k in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
            left, right = u[..., i] * v[..., j], u[..., j] * v[..., i]
            value += (left - right) * w[..., k]
            size += (np.abs(left) + np.abs(right)) * np.abs(w[..., k])
        largest = np.maximum(1.0, np.abs(w).max(axis=-1))
        certain = (np.abs(value) > CANCELLATION * size) & (size > UNDERFLOW * largest)
    # a coordinate that is equal in all points makes a determinant with a column of zeros
    zero = ((u == 0.0) & (v == 0.0) & (w == 0.0)).any(axis=-1)
    return _corrected(np.where(zero, 0.0, value), certain | zero, _volume_exactly, a, b, c, p)


def _together(width: int, *points: ArrayLike) -> list[Array]:
    try:
        arrays = [real_array(point) for point in points]
    except (TypeError, ValueError, OverflowError):
        raise InputError(f"expected points of shape (..., {width}), got something else than numbers") from None
    if any(array.shape[-1:] != (width,) for array in arrays):
        raise InputError(f"expected points of shape (..., {width}), got {[array.shape for array in arrays]}")
    if not all(np.isfinite(array).all() for array in arrays):
        raise InputError("expected finite coordinates, got NaN or infinity")
    try:
        return list(np.broadcast_arrays(*arrays))
    except ValueError:
        raise InputError(f"expected shapes that broadcast, got {[array.shape for array in arrays]}") from None


def _corrected(value: Array, certain: NDArray[np.bool_], exactly: Any, *points: Array) -> Array:
    if certain.all():
        return value
    value = np.array(value)
    limit = _limits.get()
    if limit is not None:
        limit[0] -= int(np.count_nonzero(~certain))
        if limit[0] < 0:
            raise TooCostlyError("determinants: expected fewer that need exact arithmetic")
    chosen = np.stack([point[~certain] for point in points], axis=1)  # (m, points, width)
    # as integers: every coordinate of a row is digits * 2^exponent
    mantissa, exponent = np.frexp(chosen)
    digits = (mantissa * 2.0**53).astype(np.int64)
    shift = np.where(digits == 0, np.iinfo(np.int32).max, exponent - 53).astype(np.int64)
    smallest = shift.min(axis=(1, 2))
    shift = np.where(digits == 0, 0, shift - smallest[:, None, None])
    integers = np.left_shift(digits.astype(object), shift.astype(object))
    degree = chosen.shape[2]
    determinants = exactly(*np.moveaxis(integers, 1, 0))
    value[~certain] = [_to_float(d, degree * int(e)) for d, e in zip(determinants, smallest, strict=True)]
    return value


def _cross_exactly(a: Any, b: Any, c: Any, d: Any) -> Any:
    u, v = b - a, d - c
    return u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0]


def _volume_exactly(a: Any, b: Any, c: Any, p: Any) -> Any:
    u, v, w = b - a, c - a, p - a
    return (
        (u[:, 1] * v[:, 2] - u[:, 2] * v[:, 1]) * w[:, 0]
        + (u[:, 2] * v[:, 0] - u[:, 0] * v[:, 2]) * w[:, 1]
        + (u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0]) * w[:, 2]
    )


def _to_float(value: int, exponent: int) -> float:
    """value * 2^exponent; on underflow or overflow, the smallest or largest number with the same sign."""
    if value == 0:
        return 0.0
    sign = 1.0 if value > 0 else -1.0  # not by copysign, because an integer may be too large for a float
    excess = max(value.bit_length() - 64, 0)
    try:
        result = ldexp(float(value >> excess), excess + exponent)
    except OverflowError:
        return sign * LARGEST
    return result or sign * SMALLEST
