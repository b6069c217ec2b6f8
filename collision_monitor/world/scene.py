"""What every scene is: descriptions of its objects, and the states of those that move, step by step."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod

import numpy as np
from numpy.typing import NDArray

from collision_monitor.errors import InputError
from collision_monitor.objects.description import ObjectDescription
from collision_monitor.records import STATE

Array = NDArray[np.float64]
States = NDArray[np.void]
"""An array of `records.STATE`."""

MAX_STEP = 60.0
"""s: a longer step is a mistake of the caller's clock, and would take scenes with bounces and turns very long."""
TIME_ROUND_OFF = 1e-6
"""s: more than the sum of millions of steps loses; less than any step."""


class Scene(ABC):
    """A simulated world. The same name, objects, seed and steps give the same bits."""

    name: str
    rate: float
    """Hz, the steps per second it is made for."""
    duration: float | None = None
    """s, after which it has nothing more to show; None: endless."""
    time: float = 0.0
    """s since the start."""
    descriptions: list[ObjectDescription]

    @abstractmethod
    def states(self) -> States:
        """The states at `time`, ascending ids: the moving objects only, and of those the ones that are seen."""

    @abstractmethod
    def _advance(self, dt: float) -> None:
        """Move everything on by `dt` seconds, from `time`."""

    def step(self, dt: float | None = None) -> States:
        """Move on by `dt` seconds (default: 1 / rate) and return the states there. Raises InputError."""
        dt = 1.0 / self.rate if dt is None else float(dt)
        if not 0.0 < dt <= MAX_STEP:
            raise InputError(f"step: expected more than 0 and at most {MAX_STEP:g} s, got {dt!r}")
        self._advance(dt)
        self.time += dt
        return self.states()

    @property
    def finished(self) -> bool:
        """Whether `time` is past `duration`."""
        return self.duration is not None and self.time > self.duration + TIME_ROUND_OFF


def state_array(ids: NDArray[np.uint32]) -> States:
    """States of these objects with everything else at rest in the origin, exactly known."""
    states = np.zeros(len(ids), dtype=STATE)
    states["id"] = ids
    states["quaternion"][:, 3] = 1.0
    return states


def positive_rate(rate: float | None, default: float) -> float:
    """`rate` in Hz, or the default where it is None. Raises InputError."""
    if rate is None:
        return default
    if not (math.isfinite(rate) and 0.1 <= rate <= 10_000.0):
        raise InputError(f"rate: expected 0.1 to 10000 Hz, got {rate!r}")
    return float(rate)


def object_count(objects: int | None, default: int, least: int, most: int, scene: str) -> int:
    """How many moving objects, or the default where it is None. Raises InputError."""
    if objects is None:
        return default
    if isinstance(objects, bool) or not isinstance(objects, int) or not least <= objects <= most:
        raise InputError(f"objects: the scene {scene!r} takes a whole number from {least} to {most}, got {objects!r}")
    return objects
