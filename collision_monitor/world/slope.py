"""Slope: boxes and spheres of different friction on a plane; some slide, some roll, some stay, all meet at its foot."""

from __future__ import annotations

from math import cos, radians, sin
from typing import ClassVar, Final

import numpy as np

from collision_monitor.shapes.pose import Pose, from_rotation_vector
from collision_monitor.shapes.registry import Box, Sphere
from collision_monitor.world.rigid.response_choice import AS_USUAL, ResponseChoice
from collision_monitor.world.rigid.rigid_scene import GROUND, RigidScene
from collision_monitor.world.scene import object_count, positive_rate

ANGLE: Final = radians(20.0)
"""Inclination (rad); boxes with a friction below its tangent, 0.364, slide."""
FRICTION: Final = (0.1, 0.8)
"""Range of the coefficients of friction."""
LANE: Final = 0.5
"""Distance between neighbours across the slope (m)."""
LENGTH: Final = 8.0
"""Length of the slope (m)."""
EXTENTS: Final = (0.2, 0.35)
"""Range of the extents of boxes and of the diameters of spheres (m)."""
THICKNESS: Final = 0.2
"""Thickness of the slope, the floor and the stop (m)."""
LANES: Final = 8
"""Bodies side by side; more stand higher up, in rows."""


class Slope(RigidScene):
    """Scene "slope": ids 1..n, every third a sphere. Downhill is +x; the foot of the slope is the origin."""

    parts: ClassVar[int] = 2

    def __init__(self, objects: int | None, seed: int, rate: float | None, choice: ResponseChoice = AS_USUAL) -> None:
        self.name = "slope"
        self.rate = positive_rate(rate, 100.0)
        count = object_count(objects, 16, 1, 500, self.name)
        random = np.random.default_rng(seed)
        rows = -(-count // LANES)
        length, width = LENGTH + 2 * LANE * rows, LANES * LANE
        down, up = np.array([cos(ANGLE), 0.0, -sin(ANGLE)]), np.array([sin(ANGLE), 0.0, cos(ANGLE)])
        turned = from_rotation_vector(np.array([0.0, ANGLE, 0.0]))
        extent = random.uniform(*EXTENTS, (count, 3))
        k = np.arange(count)
        ball = k % 3 == 2
        height = np.where(ball, extent[:, 0], extent[:, 2]) / 2
        along = LENGTH / 2 + 2 * LANE * (k // LANES)
        position = -along[:, None] * down + height[:, None] * up
        position[:, 1] = (k % LANES - (LANES - 1) / 2) * LANE
        moving = [
            (f"ball_{i + 1}", Sphere(e[0] / 2)) if b else (f"box_{i + 1}", Box(e))
            for i, (e, b) in enumerate(zip(extent, ball, strict=True))
        ]
        floor = 3.0
        static = [
            ("slope", Box((length, width, THICKNESS)), Pose(-length / 2 * down - THICKNESS / 2 * up, turned), GROUND),
            ("floor", Box((floor, width, THICKNESS)), Pose((floor / 2, 0.0, -THICKNESS / 2)), GROUND),
            ("stop", Box((THICKNESS, width, 1.0)), Pose((floor + THICKNESS / 2, 0.0, 0.5)), 1),
        ]
        options = choice.options(0.3)
        self._build(moving, position, random.uniform(*FRICTION, count), static, options, 6.0)
        self.world.quaternion[:count] = turned
