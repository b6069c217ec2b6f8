"""Pile: boxes and spheres fall into a bin and come to rest on each other."""

from __future__ import annotations

from math import ceil
from typing import ClassVar, Final

import numpy as np

from collision_monitor.shapes.pose import Pose
from collision_monitor.shapes.registry import Box, Sphere
from collision_monitor.world.rigid.response_choice import AS_USUAL, ResponseChoice
from collision_monitor.world.rigid.rigid_scene import GROUND, RigidScene
from collision_monitor.world.scene import object_count, positive_rate

EXTENTS: Final = (0.2, 0.4)
"""Range of the extents of boxes and of the diameters of spheres (m)."""
SPACING: Final = 0.75
"""Distance between neighbours at the start (m), more than the diagonal of the largest box."""
SIDE: Final = 3
"""Bodies side by side at the start, along x and y."""
FRICTION: Final = 0.5
"""Coefficient of friction of all bodies."""
WALL: Final = 0.2
"""Thickness of the floor and the walls (m)."""
ROOM_ABOVE: Final = 1.0
"""Height of the walls over the highest body at the start (m); the floor goes on outside for what bounces out."""


class Pile(RigidScene):
    """Scene "pile": ids 1..n, boxes and spheres in turn; then four walls and the floor."""

    parts: ClassVar[int] = 2

    def __init__(self, objects: int | None, seed: int, rate: float | None, choice: ResponseChoice = AS_USUAL) -> None:
        self.name = "pile"
        self.rate = positive_rate(rate, 100.0)
        count = object_count(objects, 20, 1, 500, self.name)
        random = np.random.default_rng(seed)
        k = np.arange(count)
        side = max(SIDE, ceil((count / 4) ** (1 / 3)))
        cell = np.stack([k % side, k // side % side, k // side**2], axis=1)
        position = (cell - [(side - 1) / 2, (side - 1) / 2, 0.0]) * SPACING + [0.0, 0.0, SPACING]
        position[:, :2] += random.uniform(-0.05, 0.05, (count, 2))
        extent = random.uniform(*EXTENTS, (count, 3))
        moving = [
            (f"ball_{i + 1}", Sphere(e[0] / 2)) if i % 2 else (f"box_{i + 1}", Box(e)) for i, e in enumerate(extent)
        ]
        room = side * SPACING
        height = float(position[-1, 2]) + ROOM_ABOVE
        along, across = Box((room + 2 * WALL, WALL, height)), Box((WALL, room, height))
        far = (room + WALL) / 2
        static = [
            ("wall_left", along, Pose((0.0, far, height / 2)), 1),
            ("wall_right", along, Pose((0.0, -far, height / 2)), 1),
            ("wall_back", across, Pose((-far, 0.0, height / 2)), 1),
            ("wall_front", across, Pose((far, 0.0, height / 2)), 1),
            ("floor", Box((5 * room, 5 * room, WALL)), Pose((0.0, 0.0, -WALL / 2)), GROUND),
        ]
        options = choice.options(0.3)
        self._build(moving, position, np.full(count, FRICTION), static, options, 8.0)
        turn = random.normal(size=(count, 4))
        self.world.quaternion[:count] = turn / np.linalg.norm(turn, axis=1, keepdims=True)
