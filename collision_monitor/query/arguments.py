"""Checks of a user's arguments; numbers become float and int, because other types would compile the kernels anew."""

from __future__ import annotations

import math
import operator
from collections.abc import Sequence
from typing import Any

import numpy as np

from collision_monitor.errors import InputError, PoseError
from collision_monitor.geometry.coordinates import real_number
from collision_monitor.shapes.pose import Pose
from collision_monitor.shapes.registry import Shape

Compound = Shape | Sequence[tuple[Shape, Pose]]
"""A shape, or several with their poses in the object's frame."""


def finite_number(name: str, value: Any, positive: bool = False) -> float:
    """Return a finite float >= 0, or > 0 if `positive`. Raises InputError."""
    try:
        result = real_number(value)
    except (TypeError, ValueError, OverflowError):
        result = math.nan
    if not (math.isfinite(result) and (result > 0.0 if positive else result >= 0.0)):
        bounds = "above 0" if positive else "at least 0"
        raise InputError(f"{name}: expected a finite number, {bounds}, got {value!r}")
    return result


def whole_number(name: str, value: Any) -> int:
    """Return a whole number >= 1, limited to 2^31. Raises InputError."""
    try:
        result = operator.index(value)
    except TypeError:
        result = 0
    if result < 1:
        raise InputError(f"{name}: expected a whole number from 1, got {value!r}")
    return min(result, 2**31)


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
