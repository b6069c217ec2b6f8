"""Scene "hard_spheres": the event-driven simulation between walls, for a monitor to watch."""

from __future__ import annotations

from typing import Final

import numpy as np

from collision_monitor.objects.description import ObjectDescription
from collision_monitor.shapes.registry import Sphere
from collision_monitor.world.hard_spheres.simulation import HardSpheres
from collision_monitor.world.rigid.walls import closed_box
from collision_monitor.world.scene import Scene, States, object_count, positive_rate, state_array

RADII: Final = (0.10, 0.25)
"""Range of the radii (m)."""
PACKING: Final = 0.02
"""Part of the box that the spheres fill; each then collides about once a second, and half as often with a wall."""


class HardSpheresScene(Scene):
    """Ids 1..n for the spheres, followed by the six walls. States are exact; sphere k of `spheres` is object k + 1."""

    def __init__(self, objects: int | None, seed: int, rate: float | None) -> None:
        self.name = "hard_spheres"
        self.rate = positive_rate(rate, 100.0)
        count = object_count(objects, 200, 1, 100_000, self.name)
        radii = np.random.default_rng(seed).uniform(*RADII, count)
        self.spheres = HardSpheres(count, PACKING, seed, radii=radii)
        self._ids = np.arange(1, count + 1, dtype=np.uint32)
        self.descriptions = [
            ObjectDescription(int(i), Sphere(r), f"sphere_{i}") for i, r in zip(self._ids, radii, strict=True)
        ]
        self.descriptions += closed_box(self.spheres.side, count + 1)

    def _advance(self, dt: float) -> None:
        self.spheres.run(dt)

    def states(self) -> States:
        """Return the current states. See Scene."""
        states = state_array(self._ids)
        states["position"] = self.spheres.positions
        states["linear"] = self.spheres.velocities
        return states
