"""Spheres in a closed box, simulated step by step: straight flight, collisions with the walls and with each other."""

from __future__ import annotations

import numpy as np

from collision_monitor.objects.description import ObjectDescription
from collision_monitor.shapes.registry import Sphere
from collision_monitor.world.hard_spheres.time_step import step_spheres
from collision_monitor.world.rigid.walls import closed_box
from collision_monitor.world.scene import Array, Scene, States, object_count, positive_rate, state_array

RADII = (0.10, 0.25)
"""Range of the radii (m)."""
SPACING = 0.8
"""Distance (m) between neighbours at the start; the box grows with the number of particles at constant density."""
SPEEDS = (0.2, 1.5)
"""Range of the speeds at the start (m/s)."""
DENSITY = 1000.0
"""Density of the particles (kg/m^3)."""


class Particles(Scene):
    """Scene "particles": ids 1..n for the particles, followed by the six walls. `restitution` applies to both."""

    def __init__(self, objects: int | None, seed: int, rate: float | None, restitution: float = 1.0) -> None:
        self.name = "particles"
        self.rate = positive_rate(rate, 100.0)
        count = object_count(objects, 200, 1, 100_000, self.name)
        random = np.random.default_rng(seed)
        self.restitution = restitution

        self._ids = np.arange(1, count + 1, dtype=np.uint32)
        self.radius = random.uniform(*RADII, count)
        self.mass = DENSITY * 4.0 / 3.0 * np.pi * self.radius**3
        side = int(np.ceil(round(count ** (1.0 / 3.0), 9)))
        self.size = side * SPACING  # of the box, from 0 to size on each axis (m)
        place = random.permutation(side**3)[:count]
        lattice = np.stack(np.unravel_index(place, (side, side, side)), axis=1)
        jitter = random.uniform(-1.0, 1.0, (count, 3)) * (SPACING / 2 - self.radius)[:, None]
        self.position: Array = (lattice + 0.5) * SPACING + jitter  # each inside its own cell, without overlaps
        direction = random.normal(size=(count, 3))
        direction /= np.linalg.norm(direction, axis=1, keepdims=True)
        self.velocity: Array = direction * random.uniform(*SPEEDS, (count, 1))

        self.descriptions = [
            ObjectDescription(int(i), Sphere(r), f"particle_{i}") for i, r in zip(self._ids, self.radius, strict=True)
        ]
        self.descriptions += closed_box(self.size, count + 1)

    def _advance(self, dt: float) -> None:
        """Find the contacts from the positions at the step's start; each answers at its time and the step goes on."""
        self.position, self.velocity = step_spheres(
            self.position, self.velocity, self.radius, self.mass, self.size, dt, self.restitution
        )

    @property
    def energy(self) -> float:
        """Kinetic energy of all particles (J)."""
        return float(0.5 * (self.mass * (self.velocity**2).sum(axis=1)).sum())

    def states(self) -> States:
        """Return the current states. See Scene."""
        states = state_array(self._ids)
        states["position"] = self.position
        states["linear"] = self.velocity
        return states
