"""Compounds: objects of several shapes, each with its pose in the object's frame."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np

from collision_monitor.errors import PoseError, ShapeError
from collision_monitor.shapes.pose import Pose, as_pose
from collision_monitor.shapes.registry import Mesh, Shape

Compound = Shape | Sequence[tuple[Shape, Pose]]
"""A shape, or several with their poses in the object's frame."""


def shape_pairs(value: Any, what: str) -> tuple[tuple[Shape, Pose], ...]:
    """Normalise a shape or a list of (shape, pose in the object's frame). A shape may be a trimesh object.

    Raises ShapeError with `what` as the name.
    """
    value = _known_shape(value)
    if isinstance(value, Shape):
        return ((value, Pose()),)
    if not isinstance(value, Iterable):
        raise ShapeError(f"{what}: expected a shape or a list of (shape, pose), got {value!r}")
    if isinstance(value, np.ndarray):  # one of no dimensions is Iterable, and raises
        value = value.tolist() if value.ndim else [value.item()]
    pairs = tuple(_pair(tuple(item) if isinstance(item, Iterable) else item, what) for item in value)
    if not pairs:
        raise ShapeError(f"{what}: expected at least one shape, got none")
    return pairs


def _known_shape(value: Any) -> Any:
    """A shape of ours for an object with vertices and faces, such as that of trimesh; anything else as it is."""
    if isinstance(value, Shape) or not (hasattr(value, "vertices") and hasattr(value, "faces")):
        return value
    return Mesh(value)


def _pair(pair: Any, what: str) -> tuple[Shape, Pose]:
    if isinstance(pair, tuple) and len(pair) == 2 and isinstance(shape := _known_shape(pair[0]), Shape):
        try:
            return shape, as_pose(pair[1], "pose")
        except PoseError:
            pass
    got = f"got {pair!r:.200} in the list; write [(shape, Pose()), …]"
    raise ShapeError(f"{what}: expected a shape or a list of (shape, pose), {got}")
