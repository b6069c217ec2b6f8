"""Filters of the answers: objects outside of a region, slow encounters, and pairs that move apart.

A filter only removes answers. The other answers do not change.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from collision_monitor.motion.bodies import BodyTable
from collision_monitor.motion.extrapolated import extrapolated
from collision_monitor.records import Method
from collision_monitor.settings.setting import EVERYWHERE, Vector


def is_bounded(low: Vector, high: Vector) -> bool:
    """Whether the region from low to high (m) excludes anything."""
    return min(high) < EVERYWHERE or max(low) > -EVERYWHERE


def bodies_in(
    bodies: BodyTable, top: int, now: float, low: Vector, high: Vector, stale_acceleration: float
) -> NDArray[np.bool_]:
    """Mask (top,) of the bodies whose bounding spheres may reach into the box from low to high (m) at `now`.

    A stale object widens its bounds here: the radius of its sphere grows by what it may have moved off its predicted
    path since its last state, at stale_acceleration (m/s^2).
    """
    there = extrapolated(bodies, np.arange(top), now)
    outside = np.maximum(np.maximum(np.asarray(low) - there.position, there.position - np.asarray(high)), 0.0)
    reach = bodies.motion["radius"][:top] + 0.5 * stale_acceleration * there.age**2
    return np.asarray((outside**2).sum(axis=1) <= reach**2)


def closes_fast(predictions: NDArray[np.void], least: float) -> NDArray[np.bool_]:
    """Mask of the predictions with a closing speed of at least `least` m/s, or with an unknown one."""
    return np.asarray(~(predictions["closing_speed"] < least) | (predictions["method"] == Method.BOUND))


def approaches(bodies: BodyTable, i: NDArray[np.int32], j: NDArray[np.int32], now: float) -> NDArray[np.bool_]:
    """Mask of the pairs of bodies i and j (n,) whose origins approach each other, or keep their distance, at `now`."""
    a, b = extrapolated(bodies, i, now), extrapolated(bodies, j, now)
    return np.asarray(((b.position - a.position) * (b.velocity - a.velocity)).sum(axis=1) <= 0.0)
