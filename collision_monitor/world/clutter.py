"""Boxes, spheres, capsules and cylinders of many sizes that drift, turn and pass through each other."""

from __future__ import annotations

import numpy as np

from collision_monitor.objects.description import ObjectDescription
from collision_monitor.shapes.pose import from_rotation_vector, multiply
from collision_monitor.shapes.registry import Box, Capsule, Cylinder, Shape, Sphere
from collision_monitor.world.rigid.collision_response import bounce_between_walls
from collision_monitor.world.scene import Array, Scene, States, object_count, positive_rate, state_array

CUBE_PER_OBJECT = 1.0
"""Side (m) of the cube of space per object, at any number of objects."""
EXTENTS = (0.1, 0.5)
"""Range (m) of the extents and lengths; radii are half of that."""
MAX_SPEED, MAX_TURN_RATE = 1.0, 1.0
"""Largest components of velocity (m/s) and angular velocity (rad/s)."""


class Clutter(Scene):
    """Scene "clutter": ids 1..n in the order box, sphere, capsule, cylinder, box, ...; the walls are not objects."""

    def __init__(self, objects: int | None, seed: int, rate: float | None) -> None:
        self.name = "clutter"
        self.rate = positive_rate(rate, 50.0)
        count = object_count(objects, 200, 1, 100_000, self.name)
        random = np.random.default_rng(seed)

        self._ids = np.arange(1, count + 1, dtype=np.uint32)
        self.size = CUBE_PER_OBJECT * count ** (1.0 / 3.0)
        self.position: Array = random.uniform(0.0, self.size, (count, 3))
        self.velocity: Array = random.uniform(-MAX_SPEED, MAX_SPEED, (count, 3))
        self.angular: Array = random.uniform(-MAX_TURN_RATE, MAX_TURN_RATE, (count, 3))
        start = random.normal(size=(count, 4))
        self._start_quaternion = start / np.linalg.norm(start, axis=1, keepdims=True)
        self._turned_for = 0.0

        sizes = random.uniform(*EXTENTS, (count, 3))
        self.descriptions = [_describe(int(i), size) for i, size in zip(self._ids, sizes, strict=True)]

    def _advance(self, dt: float) -> None:
        low, high = np.zeros(3), np.full(3, self.size)
        self.position, self.velocity = bounce_between_walls(self.position, self.velocity, low, high, dt)
        self._turned_for += dt

    def states(self) -> States:
        """Return the current states. See Scene."""
        states = state_array(self._ids)
        states["position"] = self.position
        states["linear"] = self.velocity
        states["angular"] = self.angular
        turned = from_rotation_vector(self.angular * self._turned_for)
        states["quaternion"] = multiply(turned, self._start_quaternion)
        return states


def _describe(object_id: int, size: Array) -> ObjectDescription:
    x, y, z = (float(s) for s in size)
    kinds: list[tuple[str, Shape]] = [
        ("box", Box((x, y, z))),
        ("sphere", Sphere(x / 2)),
        ("capsule", Capsule(x / 2, z)),
        ("cylinder", Cylinder(x / 2, z)),
    ]
    kind, shape = kinds[(object_id - 1) % len(kinds)]
    return ObjectDescription(object_id, shape, f"{kind}_{object_id}")
