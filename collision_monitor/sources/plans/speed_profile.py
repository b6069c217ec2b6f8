"""When a robot is where on a path: as fast as its limits of speed, acceleration and lateral acceleration allow.

The square of the speed rises and falls by 2 a along the way, so the fastest one below a limit at each place is a
running minimum, forwards and backwards (Bobrow, Dubowsky and Gibson, Time-optimal control of robotic manipulators along
specified paths, 1985, with constant bounds along the path).
"""

from __future__ import annotations

from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

SLOWEST: Final = 1e-3
"""m/s: the least limit of a speed. Smaller: a wrong unit, and a plan of hours."""

CHORD: Final = 0.5
"""m on both sides of a point over which the path's bend counts. Smaller: the steps of a path on a grid of 5 cm count as
bends. Larger: a robot is planned faster through a tight bend than it goes."""


class SpeedLimits(NamedTuple):
    """speed: m/s; 0: not given. acceleration, lateral: m/s^2, along the path and across it; infinite: no limit."""

    speed: float
    acceleration: float = np.inf
    lateral: float = np.inf

    @property
    def vary(self) -> bool:
        """Whether the speed is not the same everywhere."""
        return min(self.acceleration, self.lateral) < np.inf

    @property
    def ramp(self) -> float:
        """Way (m) from rest to the full speed."""
        return 0.5 * self.speed**2 / self.acceleration if self.acceleration < np.inf else np.inf


def profile_times(way: Floats, position: Floats, limits: SpeedLimits, speed: float, *, stops: bool) -> Floats:
    """Times (N,) at which the places of a path are reached, from 0 on (s).

    way (N,): m along the path, rising; position (N, 3). N is at least 3 where the acceleration is limited. speed: that
    at the first place (m/s), which counts if the acceleration is limited. stops: the robot stands at the last place.
    """
    most = np.full(len(way), limits.speed**2)
    if limits.lateral < np.inf:
        bends = _curvature(way, position)
        most = np.minimum(most, limits.lateral / np.maximum(bends, limits.lateral / limits.speed**2))
    squares = np.maximum(most, SLOWEST**2)
    if limits.acceleration < np.inf:
        gained = 2.0 * limits.acceleration * (way - way[0])
        most[0] = min(most[0], speed * speed)
        if stops:
            most[-1] = 0.0
        forwards = np.minimum.accumulate(most - gained) + gained
        backwards = np.minimum.accumulate((most + gained)[::-1])[::-1] - gained
        squares = np.maximum(np.minimum(forwards, backwards), speed * speed - gained)
        squares[1:-1] = np.maximum(squares[1:-1], SLOWEST**2)
    speeds = np.sqrt(np.maximum(squares, 0.0))
    return np.append(0.0, np.cumsum(2.0 * np.diff(way) / (speeds[:-1] + speeds[1:])))


def _curvature(way: Floats, position: Floats) -> Floats:
    """Curvature (N,) of a path (1/m): the angle between the chords of CHORD before and behind each point."""
    before, behind = (np.clip(way + sign * CHORD, way[0], way[-1]) for sign in (-1.0, 1.0))
    places = [np.column_stack([np.interp(s, way, column) for column in position.T]) for s in (before, behind)]
    one, other = position - places[0], places[1] - position
    angle = np.arctan2(np.linalg.norm(np.cross(one, other), axis=1), (one * other).sum(axis=1))
    return np.asarray(angle / CHORD)
