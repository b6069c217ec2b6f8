"""Spheres in a closed box: straight flight, exact bounces off the walls, elastic collisions with each other."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from collision_monitor._jit import allocating_kernel
from collision_monitor.geometry.pose import Pose
from collision_monitor.geometry.shapes import Box, Sphere
from collision_monitor.objects.description import ObjectDescription
from collision_monitor.response.two_bodies import collide
from collision_monitor.world.collision_response import bounce_between_walls
from collision_monitor.world.scene import Array, Scene, States, object_count, positive_rate, state_array

Integers = NDArray[np.int64]

RADII = (0.10, 0.25)
"""Range of the radii (m)."""
SPACING = 0.8
"""Distance (m) between neighbours at the start; the box grows with the number of particles at constant density."""
SPEEDS = (0.2, 1.5)
"""Range of the speeds at the start (m/s)."""
DENSITY = 1000.0
"""Density of the particles (kg/m^3)."""
WALL = 0.2
"""Thickness of the walls (m)."""


@allocating_kernel
def _overlapping_pairs(position, radius, cell_size, cells):  # type: ignore[no-untyped-def]
    """Pairs (n, 2) of overlapping spheres in a fixed order; the cell is at least as large as the largest sphere."""
    n = len(position)
    where = np.empty((n, 3), np.int64)
    first = np.zeros(cells**3 + 1, np.int64)
    for i in range(n):
        for k in range(3):
            where[i, k] = min(max(int(position[i, k] / cell_size), 0), cells - 1)
        first[(where[i, 0] * cells + where[i, 1]) * cells + where[i, 2] + 1] += 1
    for c in range(cells**3):
        first[c + 1] += first[c]
    member = np.empty(n, np.int64)
    filled = first[:-1].copy()
    for i in range(n):
        c = (where[i, 0] * cells + where[i, 1]) * cells + where[i, 2]
        member[filled[c]] = i
        filled[c] += 1
    found = []
    for i in range(n):
        for x in range(max(where[i, 0] - 1, 0), min(where[i, 0] + 2, cells)):
            for y in range(max(where[i, 1] - 1, 0), min(where[i, 1] + 2, cells)):
                row = (x * cells + y) * cells
                start = first[row + max(where[i, 2] - 1, 0)]
                for m in range(start, first[row + min(where[i, 2] + 1, cells - 1) + 1]):
                    j = member[m]
                    if j <= i:
                        continue
                    distance2 = 0.0
                    for k in range(3):
                        distance2 += (position[j, k] - position[i, k]) ** 2
                    if distance2 <= (radius[i] + radius[j]) ** 2:
                        found.append((i, j))
    pairs = np.empty((len(found), 2), np.int64)
    for p in range(len(found)):
        pairs[p, 0], pairs[p, 1] = found[p]
    return pairs


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
        self.descriptions += self._walls(count)

    def _walls(self, count: int) -> list[ObjectDescription]:
        walls: list[ObjectDescription] = []
        for k, axis in enumerate("xyz"):
            for end, at in (("low", -WALL / 2), ("high", self.size + WALL / 2)):
                size, centre = np.full(3, self.size + 2 * WALL), np.full(3, self.size / 2)
                size[k], centre[k] = WALL, at
                pose = Pose(centre)
                object_id = count + len(walls) + 1
                walls.append(ObjectDescription(object_id, Box(size), f"wall_{axis}_{end}", static=True, pose=pose))
        return walls

    def _advance(self, dt: float) -> None:
        """Advance in substeps of at most half the least radius, so that no overlap is skipped."""
        fastest = float(np.sqrt((self.velocity**2).sum(axis=1).max()))
        parts = max(1, int(np.ceil(dt * fastest / (RADII[0] / 2))))
        low, high = self.radius[:, None], self.size - self.radius[:, None]
        for _ in range(parts):
            self.position, self.velocity = bounce_between_walls(
                self.position, self.velocity, low, high, dt / parts, self.restitution
            )
            self._respond()

    def _respond(self) -> None:
        """Let overlapping particles collide: each pair once, and the pairs of one particle one after another."""
        cells = max(1, int(self.size / (2 * RADII[1])))
        pairs: Integers = _overlapping_pairs(  # type: ignore[no-untyped-call]
            self.position, self.radius, self.size / cells, cells
        )
        while len(pairs):
            a, b = pairs.T
            turn = np.full(len(self.position), len(pairs))  # the first remaining pair of each particle
            order = np.arange(len(pairs))
            np.minimum.at(turn, a, order)
            np.minimum.at(turn, b, order)
            now = (turn[a] == order) & (turn[b] == order)
            i, j = a[now], b[now]
            self.velocity[i], self.velocity[j] = collide(
                self.velocity[i], self.velocity[j], self.position[j] - self.position[i],
                self.mass[i], self.mass[j], self.restitution,
            )  # fmt: skip
            pairs = pairs[~now]

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
