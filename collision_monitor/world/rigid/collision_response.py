"""Bodies in a box: bounces between axis-aligned walls. What bodies do when they meet is in response/."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


def bounce_between_walls(
    position: Array, velocity: Array, low: Array, high: Array, dt: float, restitution: float = 1.0
) -> tuple[Array, Array]:
    """Position and velocity after `dt` seconds between axis-aligned walls, with each bounce at its exact time.

    low, high: where the body's centre turns back. Bounce k ends a crossing of high - low at the speed
    restitution**k |v|, so the times of the bounces are a geometric series. Below 1, the number of bounces in `dt` is
    its solution, however many they are; a body with restitution 0 stays at the wall. Source: own derivation.
    """
    moved = position + velocity * dt
    inside = (moved >= low) & (moved <= high)  # kept without any round-off
    room, speed = high - low, np.abs(velocity)
    with np.errstate(all="ignore"):  # where nothing bounces, the formulas divide by 0
        to_wall = np.where(velocity > 0.0, high - position, position - low)
        left = np.maximum(dt - to_wall / speed, 0.0)  # after the first bounce
        travelled = left * speed / room  # crossings after it without loss
        if restitution == 1.0:
            crossings = begun = np.floor(travelled)
        else:
            decay = -np.log(restitution)  # infinite for 0
            crossings = np.floor(np.log1p(travelled * (1.0 - restitution)) / decay)
            begun = np.where(crossings > 0.0, np.expm1(crossings * decay), 0.0) / (1.0 - restitution)
        after = restitution ** (crossings + 1.0)
        from_wall = np.clip((left - begun * room / speed) * after * speed, 0.0, room)
    upwards = (velocity > 0.0) == (np.mod(crossings, 2.0) == 1.0)
    bounced = np.where(upwards, low + from_wall, high - from_wall)
    return (
        np.where(inside, moved, np.clip(bounced, low, high)),
        np.where(inside, velocity, np.where(upwards, after * speed, -after * speed)),
    )
