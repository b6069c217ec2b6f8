"""Drones that circle through each other's space, each on its own loop, so that no twist is ever constant."""

from __future__ import annotations

from typing import Final

import numpy as np

from collision_monitor.objects.description import ObjectDescription
from collision_monitor.shapes.registry import Cylinder
from collision_monitor.world.scene import Array, Scene, States, object_count, positive_rate, state_array

CUBE_PER_DRONE: Final = 3.0
"""Side (m) of the cube of space per drone, at any number of drones."""
LOOP_RADII: Final = (1.0, 4.0)
"""Range of the radii of the loops (m)."""
LOOP_SPEEDS: Final = (1.0, 4.0)
"""Range of the speeds along the loops (m/s)."""
RADIUS, HEIGHT = 0.3, 0.15
"""Size of a drone with its rotors (m)."""


class Swarm(Scene):
    """Scene "swarm": ids 1..n. Loops are tilted circles about points of the volume; drones stay level, facing ahead."""

    def __init__(self, objects: int | None, seed: int, rate: float | None) -> None:
        self.name = "swarm"
        self.rate = positive_rate(rate, 50.0)
        count = object_count(objects, 150, 1, 100_000, self.name)
        random = np.random.default_rng(seed)
        self._ids = np.arange(1, count + 1, dtype=np.uint32)
        self._centre: Array = random.uniform(0.0, CUBE_PER_DRONE * count ** (1.0 / 3.0), (count, 3))
        self._radius = random.uniform(*LOOP_RADII, count)
        self._rate = random.uniform(*LOOP_SPEEDS, count) / self._radius * random.choice((-1.0, 1.0), count)  # rad/s
        self._phase = random.uniform(0.0, 2.0 * np.pi, count)
        self._tilt = random.uniform(-0.5, 0.5, count)  # slope of the loop along x
        self.descriptions = [ObjectDescription(int(i), Cylinder(RADIUS, HEIGHT), f"drone_{i}") for i in self._ids]

    def _advance(self, dt: float) -> None:
        """Do nothing, because the positions are functions of the time."""

    def states(self) -> States:
        """Return the current states. See Scene."""
        angle = self._phase + self._rate * self.time
        cosine, sine = np.cos(angle), np.sin(angle)
        states = state_array(self._ids)
        out = np.stack([cosine, sine, self._tilt * cosine], axis=1)
        along = np.stack([-sine, cosine, -self._tilt * sine], axis=1)
        states["position"] = self._centre + self._radius[:, None] * out
        states["linear"] = (self._radius * self._rate)[:, None] * along
        states["quaternion"][:, 2:] = np.stack([np.sin(angle / 2), np.cos(angle / 2)], axis=1)
        states["angular"][:, 2] = self._rate
        return states
