"""Bodies in a box: bounces between axis-aligned walls. What bodies do when they meet is in response/."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


def bounce_between_walls(
    position: Array, velocity: Array, low: Array, high: Array, dt: float, restitution: float = 1.0
) -> tuple[Array, Array]:
    """Position and velocity after `dt` seconds between axis-aligned walls, with each bounce at its exact time.

    low, high: where the body's centre turns back. The speed is v before the wall and restitution * v after it, so
    the path past the wall is reflected and scaled. With restitution 1, many bounces in one step are one triangle
    wave; below 1, only one bounce per axis and step is computed, and the centre is kept inside. Source: own derivation.
    """
    moved = position + velocity * dt
    if restitution == 1.0:
        room = high - low
        phase = np.mod(moved - low, 2.0 * room)
        returning = phase > room
        inside = (moved >= low) & (moved <= high)  # kept without any round-off
        folded = np.where(returning, high - (phase - room), low + phase)
        return (
            np.where(inside, moved, np.clip(folded, low, high)),
            np.where(returning & ~inside, -velocity, velocity),
        )
    beyond = np.where(moved < low, moved - low, np.where(moved > high, moved - high, 0.0))
    folded = np.clip(moved - (1.0 + restitution) * beyond, low, high)
    return folded, np.where(beyond != 0.0, -restitution * velocity, velocity)
