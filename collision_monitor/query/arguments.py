"""Checks of a user's shapes and poses. `checks.numbers` has those of numbers."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from collision_monitor.errors import PoseError
from collision_monitor.shapes.pose import Pose
from collision_monitor.shapes.registry import Shape

Compound = Shape | Sequence[tuple[Shape, Pose]]
"""A shape, or several with their poses in the object's frame."""


def checked_pose(pose: Any, name: str) -> Pose:
    """Return the pose. Raises PoseError for anything else, with what to write instead."""
    if isinstance(pose, Pose):
        return pose
    if isinstance(pose, Shape):
        hint = "each shape is followed by its pose: shape_a, pose_a, shape_b, pose_b"
    elif (shape := _shape_of(pose)) in ((4, 4), (3, 3)):
        hint = "write Pose.from_matrix(matrix)"
    elif shape == (7,):
        hint = "write Pose((x, y, z), (qx, qy, qz, qw))"
    else:
        hint = "write Pose((x, y, z))"
    raise PoseError(f"{name}: expected a Pose, got {type(pose).__name__}; {hint}")


def _shape_of(value: Any) -> tuple[int, ...]:
    try:
        return np.shape(value)
    except ValueError:  # rows of different lengths
        return ()
