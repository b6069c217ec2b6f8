"""Shapes of tracks that change a little with every message, described so that each message need not describe anew."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np
from numpy.typing import NDArray

from collision_monitor.errors import ShapeError
from collision_monitor.shapes.registry import Cylinder

Measured = tuple[int, NDArray[np.float64]]
"""A kind, and full extents (3,) or corners (n, 3) in m."""

LEAST_EXTENT: Final = 0.01
"""m: extents of 0, of flat or unmeasured things, count as this. An object without a shape would not be monitored."""


def with_extent(sizes: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return extents in which 0 has become LEAST_EXTENT. Negative numbers and NaN stay, and are refused."""
    return np.where(sizes == 0.0, LEAST_EXTENT, sizes)


def diameter_around(sizes: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the diameters (N,) of the circles around rectangles of extents (N, 2); NaN beside a negative number."""
    return np.where((sizes >= 0.0).all(1), np.hypot(sizes[:, 0], sizes[:, 1]), np.nan)


def upright_cylinder(sizes: NDArray[np.float64]) -> Cylinder:
    """Return the cylinder of full extents (3,), with the larger of x and y as its diameter. Raises ShapeError."""
    x, y, z = sizes.tolist()
    if not (x >= 0.0 and y >= 0.0):  # `max` takes the other one, also beside NaN
        raise ShapeError(f"cylinder: expected diameters in x and y from 0 on, got {x:g} and {y:g}")
    return Cylinder(max(x, y) / 2, z)


def rounded_up(measured: Measured, tolerance: float) -> Measured:
    """Return the shape to describe: extents rounded up to a multiple of the tolerance; corners as they are."""
    kind, numbers = measured
    if numbers.ndim == 2 or tolerance == 0.0 or not (np.isfinite(numbers).all() and (numbers > 0.0).all()):
        return measured
    return kind, np.ceil(numbers / tolerance - 1e-6) * tolerance


def held_by(described: Measured, measured: Measured, tolerance: float) -> bool:
    """Whether a described shape still holds the measured one, and exceeds it by at most twice the tolerance."""
    kind, numbers = measured
    if kind != described[0] or numbers.shape != described[1].shape:
        return False
    if numbers.ndim == 2:
        return bool((np.abs(numbers - described[1]) <= tolerance).all())
    spare = described[1] - numbers
    return bool((spare >= -1e-6 * tolerance).all() and (spare <= 2.0 * tolerance).all())


def still_held(
    described: Sequence[Measured | None], kinds: NDArray[np.uint8], sizes: NDArray[np.float64], tolerance: float
) -> NDArray[np.bool_]:
    """Return `held_by` for kinds (N,) and extents (N, 3) at once; False where there is no description, or corners."""
    none = np.full(3, np.nan)
    comparable = [it[1] if it is not None and it[1].ndim == 1 and it[0] == k else none for it, k in
                  zip(described, kinds.tolist(), strict=True)]  # fmt: skip
    spare = np.array(comparable).reshape(-1, 3) - sizes
    with np.errstate(invalid="ignore"):
        return np.asarray(((spare >= -1e-6 * tolerance) & (spare <= 2.0 * tolerance)).all(1))
