"""Input check of the geometry functions: points, vectors and triangles as finite arrays of the expected shape."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from collision_monitor.checks.numbers import as_numbers, hides_some
from collision_monitor.errors import InputError, ShapeError

Array = NDArray[np.float64]
Booleans = NDArray[np.bool_]
Indices = NDArray[np.int64]
Signs = NDArray[np.int8]


def coordinates(value: ArrayLike, what: str, *widths: int) -> Array:
    """Points or vectors (..., width), at least one, with a width of `widths` (default 2 or 3). Raises InputError."""
    widths = widths or (2, 3)
    array = as_numbers(value, what)
    if array.ndim == 0 or array.shape[-1] not in widths or array.size == 0:
        shapes = " or ".join(f"(..., {width})" for width in widths)
        raise InputError(f"{what}: expected at least one point, shape {shapes}, got shape {array.shape}")
    if not np.isfinite(array).all():
        raise InputError(f"{what}: expected finite coordinates, got NaN or infinity")
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
        if hides_some(faces):
            raise TypeError
        indices = np.asarray(faces)
    except (TypeError, ValueError, OverflowError):
        raise ShapeError(f"{what} faces: expected integers of shape (m, 3), got {type(faces).__name__}") from None
    if indices.ndim != 2 or indices.shape[1] != 3 or len(indices) == 0 or indices.dtype.kind not in "iu":
        got = f"{indices.dtype} {indices.shape}"
        raise ShapeError(f"{what} faces: expected integers of shape (m, 3), m >= 1, got {got}")
    if indices.min() < 0 or indices.max() >= len(points):
        raise ShapeError(
            f"{what} faces: expected indices from 0 to {len(points) - 1}, got {indices.min()} to {indices.max()}"
        )
    return points, indices.astype(np.int64)
