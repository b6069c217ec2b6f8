"""Input check of the response functions."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from collision_monitor.checks.numbers import as_numbers, checked_array
from collision_monitor.errors import InputError
from collision_monitor.geometry.coordinates import Array, coordinates
from collision_monitor.tolerances import LARGEST_INPUT


def vectors(*values: tuple[str, ArrayLike]) -> tuple[Array, ...]:
    """Named vectors (..., 2 or 3), finite, which broadcast against each other. Raises InputError."""
    arrays = [coordinates(value, name) for name, value in values]
    for (name, _), array in zip(values, arrays, strict=True):
        if (np.abs(array) > LARGEST_INPUT).any():
            raise InputError(f"{name}: expected numbers up to {LARGEST_INPUT:g}, got {float(np.abs(array).max())!r}")
    try:
        np.broadcast_shapes(*(array.shape for array in arrays))
    except ValueError:
        found = ", ".join(f"{name} {array.shape}" for (name, _), array in zip(values, arrays, strict=True))
        raise InputError(f"expected arrays that broadcast, got {found}") from None
    return tuple(arrays)


def checked_direction(value: ArrayLike, name: str = "normal") -> Array:
    """Vectors (..., 2 or 3) scaled by a power of two to about unit length, which rounds nothing. Raises InputError."""
    array = coordinates(value, name)
    largest = np.abs(array).max(axis=-1, keepdims=True)
    if not (largest > 0.0).all():
        raise InputError(f"{name}: expected vectors with a direction, got a zero vector")
    return np.asarray(np.ldexp(array, -np.frexp(largest)[1]))


def unit(value: ArrayLike, name: str = "normal") -> Array:
    """Unit vectors (..., 2 or 3). Raises InputError for a zero vector."""
    scaled = checked_direction(value, name)
    return np.asarray(scaled / np.linalg.norm(scaled, axis=-1, keepdims=True))


def restitutions(value: ArrayLike) -> Array:
    """Coefficients of restitution (..., 1) from 0 to 1. Raises InputError."""
    array = checked_array(value, "restitution")
    if not ((array >= 0.0) & (array <= 1.0)).all():
        raise InputError(f"restitution: expected 0 (no bounce) to 1 (elastic), got {value!r:.100}")
    return array[..., None]


def masses(value: ArrayLike, name: str = "mass") -> Array:
    """Masses (..., 1) in kg, positive; infinity is an immovable body. Raises InputError."""
    array = as_numbers(value, name, "numbers of kilograms")
    if not (array > 0.0).all():
        raise InputError(f"{name}: expected positive kilograms (infinity for an immovable body), got {value!r:.100}")
    return array[..., None]
