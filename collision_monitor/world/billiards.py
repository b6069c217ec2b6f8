"""Billiards: a cue ball hits a triangle of balls on a table with cushions."""

from __future__ import annotations

from math import ceil, sqrt
from typing import Final

import numpy as np

from collision_monitor.shapes.pose import Pose
from collision_monitor.shapes.registry import Box, Sphere
from collision_monitor.world.rigid.response_choice import AS_USUAL, ResponseChoice
from collision_monitor.world.rigid.rigid_scene import GROUND, RigidScene
from collision_monitor.world.scene import object_count, positive_rate

RADIUS: Final = 0.028575
"""Radius of a ball (m): 2 1/4 inches across."""
TABLE: Final = (2.54, 1.27)
"""Least length and width of the table (m)."""
CUSHION: Final = 0.1
"""Thickness and height of the cushions, thickness of the table (m)."""
SPEED: Final = (4.0, 7.0)
"""Range of the speed of the cue ball (m/s)."""
FRICTION: Final = 0.1
"""Coefficient between balls, cushions and table."""


class Billiards(RigidScene):
    """Scene "billiards": id 1 is the cue ball, 2..n the triangle. The seed turns and speeds the shot."""

    def __init__(self, objects: int | None, seed: int, rate: float | None, choice: ResponseChoice = AS_USUAL) -> None:
        self.name = "billiards"
        self.rate = positive_rate(rate, 100.0)
        count = object_count(objects, 16, 2, 500, self.name)
        random = np.random.default_rng(seed)
        rows = ceil((sqrt(8 * (count - 1) + 1) - 1) / 2)
        length, width = max(TABLE[0], 6 * rows * RADIUS), max(TABLE[1], 3 * rows * RADIUS)
        position = np.zeros((count, 3))
        row = np.repeat(np.arange(rows), np.arange(1, rows + 1))[: count - 1]
        place = np.arange(count - 1) - row * (row + 1) // 2
        position[1:, 0] = length / 4 + sqrt(3.0) * RADIUS * row
        position[1:, 1] = RADIUS * (2 * place - row)
        position[0, 0] = -length / 4
        position[:, 2] = RADIUS
        along, across = Box((length + 2 * CUSHION, CUSHION, CUSHION)), Box((CUSHION, width, CUSHION))
        dx, dy = length / 2 + CUSHION / 2, width / 2 + CUSHION / 2
        static = [
            ("cushion_left", along, Pose((0.0, dy, CUSHION / 2)), 1),
            ("cushion_right", along, Pose((0.0, -dy, CUSHION / 2)), 1),
            ("cushion_head", across, Pose((-dx, 0.0, CUSHION / 2)), 1),
            ("cushion_foot", across, Pose((dx, 0.0, CUSHION / 2)), 1),
            ("table", Box((length, width, CUSHION)), Pose((0.0, 0.0, -CUSHION / 2)), GROUND),
        ]
        balls = [("cue" if k == 0 else f"ball_{k}", Sphere(RADIUS)) for k in range(count)]
        options = choice.options(0.95)
        self._build(balls, position, np.full(count, FRICTION), static, options, SPEED[1])
        angle = random.uniform(-1.0, 1.0) * RADIUS / (length / 2)
        self.world.velocity[0, :2] = random.uniform(*SPEED) * np.array([np.cos(angle), np.sin(angle)])
