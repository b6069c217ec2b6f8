"""The circle by its two equations: implicit, which tells where a point is, and parametric, which makes points.

(Slides "Types of equations": implicit is good for intersection tests, parametric for generating points.)
"""

from __future__ import annotations

from fractions import Fraction
from typing import Final

import numpy as np
from numpy.typing import ArrayLike

from collision_monitor.checks.numbers import checked_array
from collision_monitor.errors import InputError
from collision_monitor.geometry.coordinates import Array, coordinates

SMALLEST: Final = 2.0**-970
"""m²: smaller squares may have lost digits."""

CERTAIN: Final = 2.0**-8
"""Part of the sum of all squares from which on round-off changes a value by less than 1e-12 of it."""


def implicit_circle(p: ArrayLike, center: ArrayLike, radius: ArrayLike) -> Array:
    """f(p) = |p - center|² - radius² in m², for points (..., 2 or 3) of a circle or a sphere.

    Positive outside, 0 on the boundary, negative inside. The sign is exact for the numbers given, and the value is
    right within 1e-12 of it. Raises InputError.
    """
    p, center, radius = _circle(p, center, radius)
    with np.errstate(over="ignore", under="ignore", invalid="ignore"):
        offset = p - center
        parts = np.concatenate([offset**2, -(radius[..., None] ** 2)], axis=-1)
        value = np.asarray(parts.sum(axis=-1))
        # a difference, a square and the sums each lose half a unit of the last place
        certain = np.abs(value) > CERTAIN * np.abs(parts).sum(axis=-1)
        certain &= np.isfinite(value) & (np.abs(parts) > SMALLEST).any(axis=-1)
    for place in map(tuple, np.argwhere(~certain)):
        exact = sum((Fraction(x) - Fraction(c)) ** 2 for x, c in zip(p[place], center[place], strict=True))
        exact -= Fraction(float(radius[place])) ** 2
        value[place] = _rounded(exact)
    return value


def parametric_circle(center: ArrayLike, radius: ArrayLike, angle: ArrayLike) -> Array:
    """Points (..., 2) in m of a circle at angles (...) in rad from the x axis, counter-clockwise. Raises InputError."""
    angle = checked_array(angle, "angle")
    unit = np.stack([np.cos(angle), np.sin(angle)], axis=-1)
    middle = coordinates(center, "center", 2)
    size = checked_array(radius, "radius", least=0.0)
    try:
        return np.asarray(middle + size[..., None] * unit)
    except ValueError:
        shapes = f"{middle.shape[:-1]}, {size.shape} and {angle.shape}"
        raise InputError(f"circle: expected centres, radii and angles that broadcast, got {shapes}") from None


def _circle(p: ArrayLike, center: ArrayLike, radius: ArrayLike) -> tuple[Array, Array, Array]:
    points, middle = coordinates(p, "p"), coordinates(center, "center")
    size = checked_array(radius, "radius", least=0.0)
    try:
        points, middle = np.broadcast_arrays(points, middle)
        return points, middle, np.broadcast_to(size, points.shape[:-1])
    except ValueError:
        shapes = f"{points.shape}, {middle.shape} and {size.shape}"
        raise InputError(f"circle: expected points, centres and radii that broadcast, got {shapes}") from None


def _rounded(value: Fraction) -> float:
    """Return the number as float; one of its sign where a float has no such small or large number."""
    try:
        result = float(value)
    except OverflowError:
        result = float(np.finfo(np.float64).max) * (1.0 if value > 0 else -1.0)
    if result == 0.0 and value:
        result = 5e-324 if value > 0 else -5e-324
    return result
