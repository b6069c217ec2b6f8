"""Compounds: objects of several shapes, each with its pose in the object's frame."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np

from collision_monitor.errors import ShapeError
from collision_monitor.shapes.pose import Pose
from collision_monitor.shapes.registry import Shape

Compound = Shape | Sequence[tuple[Shape, Pose]]
"""A shape, or several with their poses in the object's frame."""


def shape_pairs(value: Any, what: str) -> tuple[tuple[Shape, Pose], ...]:
    """Normalise a shape or a list of (shape, pose in the object's frame). Raises ShapeError with `what` as the name."""
    if isinstance(value, Shape):
        return ((value, Pose()),)
    if not isinstance(value, Iterable):
        raise ShapeError(f"{what}: expected a shape or a list of (shape, pose), got {value!r}")
    if isinstance(value, np.ndarray):  # one of no dimensions is Iterable, and raises
        value = value.tolist() if value.ndim else [value.item()]
    pairs = tuple(tuple(item) if isinstance(item, Iterable) else item for item in value)
    for pair in pairs:
        is_pair = isinstance(pair, tuple) and len(pair) == 2
        if not (is_pair and isinstance(pair[0], Shape) and isinstance(pair[1], Pose)):
            got = f"got {pair!r} in the list; write [(shape, Pose()), …]"
            raise ShapeError(f"{what}: expected a shape or a list of (shape, pose), {got}")
    if not pairs:
        raise ShapeError(f"{what}: expected at least one shape, got none")
    return pairs
