"""Which points of a cloud are ground: outside of a band of heights, or on a plane that is fitted to them."""

from __future__ import annotations

from math import cos, radians
from typing import Final

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Booleans = NDArray[np.bool_]

TRIES: Final = 200
"""Planes that are tried. More: longer. Fewer: a ground of a third of the points is missed in more than 1 of 1,000."""

SAMPLE: Final = 2_000
"""Points by which a plane is judged."""

LEAST_PART: Final = 0.1
"""Part of the points that a plane holds at least; a smaller one is no ground."""


def ground_plane(points: Floats, slope: float, thickness: float) -> tuple[Floats, float] | None:
    """The plane (unit normal n (3,) upward, offset n . x) with most of the points (N, 3) in m; None if there is none.

    slope: its largest angle to the horizontal (deg). thickness: how far points on it may be off (m). The same points
    give the same plane. (Fischler, Bolles, Random sample consensus, 1981; then least squares)
    """
    if len(points) < 3:
        return None
    rng = np.random.default_rng(0)
    some = points[rng.choice(len(points), min(SAMPLE, len(points)), replace=False)]
    corners = some[rng.integers(0, len(some), (TRIES, 3))]
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    length = np.linalg.norm(normal, axis=1)
    usable = np.abs(normal[:, 2]) >= cos(radians(slope)) * length
    usable &= length > 0.0
    if not usable.any():
        return None
    normal, corners = normal[usable] / length[usable, None], corners[usable]
    normal *= np.sign(normal[:, 2:])
    offset = (normal * corners[:, 0]).sum(axis=1)
    held = (np.abs(some @ normal.T - offset) <= thickness).sum(axis=0)
    best = int(held.argmax())
    if held[best] < LEAST_PART * len(some):
        return None
    n, at = normal[best], float(offset[best])
    own = points[np.abs(points @ n - at) <= thickness]
    middle = own.mean(axis=0)
    fitted = np.linalg.svd(own - middle, full_matrices=False)[2][2] if len(own) <= 20 * SAMPLE else n
    fitted = fitted * np.sign(fitted[2]) if fitted[2] else n
    if fitted[2] >= cos(radians(slope)):
        n = fitted
    return n, float(n @ middle)


def above_ground(points: Floats, band: tuple[float, float], slope: float, thickness: float) -> Booleans:
    """Which points (N, 3) in m, with z upward, are no ground.

    band: least and greatest height (m). slope: of the ground (deg), 0: no plane is fitted. thickness: height above the
    plane up to which points are ground (m); what is below it is ground too.
    """
    kept: Booleans = (points[:, 2] >= band[0]) & (points[:, 2] <= band[1])
    plane = ground_plane(points[kept], slope, thickness) if slope > 0.0 else None
    if plane is not None:
        kept &= points @ plane[0] - plane[1] > thickness
    return kept
