"""Base class of the scenes: descriptions of the objects, and the states of the moving ones, step by step."""

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
"""Longest step (s). A longer one is an error of the caller's clock, and scenes with bounces and turns would be slow."""
TIME_ROUND_OFF = 1e-6
"""Tolerance of times (s): more than the round-off of millions of steps, and less than any step."""


class Scene(ABC):
    """A simulated world. The same name, objects, seed and steps give results identical to the bit."""

    name: str
    rate: float
    """Steps per second that the scene is designed for (Hz)."""
    duration: float | None = None
    """Time of the scene's end (s); None: endless."""
    time: float = 0.0
    """Time since the start (s)."""
    descriptions: list[ObjectDescription]

    @abstractmethod
    def states(self) -> States:
        """Return the states at `time` of the moving objects that are currently tracked, by ascending id."""

    @abstractmethod
    def _advance(self, dt: float) -> None:
        """Advance all objects by `dt` seconds from `time`."""

    def step(self, dt: float | None = None) -> States:
        """Advance by `dt` seconds (default: 1 / rate) and return the new states. Raises InputError."""
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
    """Create states of these objects, at rest at the origin and without uncertainty."""
    states = np.zeros(len(ids), dtype=STATE)
    states["id"] = ids
    states["quaternion"][:, 3] = 1.0
    return states


def positive_rate(rate: float | None, default: float) -> float:
    """Return `rate` in Hz, or the default if it is None. Raises InputError."""
    if rate is None:
        return default
    if not (math.isfinite(rate) and 0.1 <= rate <= 10_000.0):
        raise InputError(f"rate: expected 0.1 to 10000 Hz, got {rate!r}")
    return float(rate)


def object_count(objects: int | None, default: int, least: int, most: int, scene: str) -> int:
    """Return the number of moving objects, or the default if it is None. Raises InputError."""
    if objects is None:
        return default
    if isinstance(objects, bool) or not isinstance(objects, int) or not least <= objects <= most:
        raise InputError(f"objects: the scene {scene!r} takes a whole number from {least} to {most}, got {objects!r}")
    return objects
