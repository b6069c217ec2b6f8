"""The six walls of a closed box."""

from __future__ import annotations

from typing import Final

import numpy as np

from collision_monitor.objects.description import ObjectDescription
from collision_monitor.shapes.pose import Pose
from collision_monitor.shapes.registry import Box

THICKNESS: Final = 0.2
"""Thickness of the walls (m)."""


def closed_box(side: float, first_id: int) -> list[ObjectDescription]:
    """Return walls around a cube from 0 to `side` (m), with ascending ids: low and high x, then y, then z."""
    walls: list[ObjectDescription] = []
    for k, axis in enumerate("xyz"):
        for end, at in (("low", -THICKNESS / 2), ("high", side + THICKNESS / 2)):
            size, centre = np.full(3, side + 2 * THICKNESS), np.full(3, side / 2)
            size[k], centre[k] = THICKNESS, at
            wall_id = first_id + len(walls)
            walls.append(ObjectDescription(wall_id, Box(size), f"wall_{axis}_{end}", static=True, pose=Pose(centre)))
    return walls
