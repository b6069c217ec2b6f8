"""Translations that certainly part two objects that overlap."""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

from collision_monitor.geometry.bounding_volumes import KDOP_DIRECTIONS
from collision_monitor.meshes.extent import tree_extents
from collision_monitor.meshes.trees.shape_trees import shape_tree
from collision_monitor.query.posed import Posed
from collision_monitor.shapes.planar import is_planar
from collision_monitor.shapes.reach import reach
from collision_monitor.shapes.registry import HalfSpace, Mesh, Points

Array = NDArray[np.float64]

_DIRECTIONS: Final = np.array(
    [sign * np.array(d) / np.linalg.norm(d) for d in KDOP_DIRECTIONS[26] for sign in (1.0, -1.0)]
)


def parting_translation(a: Posed, b: Posed, offset: Array, normal: Array) -> float:
    """Length (m) of the shortest translation that certainly parts the two, along the normal or an axis of either."""
    planes = [
        sign * side.rotation @ pose.rotation @ shape.normal
        for side, sign in ((a, 1.0), (b, -1.0))
        for shape, pose in side.outline
        if isinstance(shape, HalfSpace)
    ]
    axes = [_DIRECTIONS @ side.rotation.T for side in (a, b)]
    directions = np.concatenate([normal[None], *axes, np.reshape(planes, (-1, 3))])
    if is_planar(a.shapes[0][0]):
        directions = directions[directions[:, 2] == 0.0]
    ends = _reach(a, directions @ a.rotation) - directions @ offset
    return float((ends + _reach(b, -directions @ b.rotation)).min())


def _reach(side: Posed, directions: Array) -> Array:
    """How far an object reaches in directions (n, 3) in its own frame (m)."""
    shape, pose = side.outline[0]
    tree = shape_tree(shape) if len(side.outline) == 1 and isinstance(shape, Mesh | Points) else None
    if tree is None:
        return reach(side.outline, directions)
    radius = shape.radius if isinstance(shape, Points) else 0.0
    return tree_extents(tree, directions @ pose.rotation) + directions @ pose.position + radius
