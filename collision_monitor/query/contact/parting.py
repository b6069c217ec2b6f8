"""Translations that certainly part two objects that overlap."""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

from collision_monitor.geometry.bounding_volumes import KDOP_DIRECTIONS
from collision_monitor.meshes.extent import tree_extents
from collision_monitor.meshes.trees.shape_trees import shape_tree
from collision_monitor.query.body import PosedShapes, QueryBody
from collision_monitor.shapes.pose import Pose
from collision_monitor.shapes.reach import reach
from collision_monitor.shapes.registry import HalfSpace, Mesh, Points

Array = NDArray[np.float64]

_DIRECTIONS: Final = np.array(
    [sign * np.array(d) / np.linalg.norm(d) for d in KDOP_DIRECTIONS[26] for sign in (1.0, -1.0)]
)


def parting_translation(a: QueryBody, pose_a: Pose, b: QueryBody, pose_b: Pose, normal: Array) -> float:
    """Length (m) of the shortest translation that certainly parts the two, along the normal or an axis of either."""
    sides = (a, pose_a, 1.0), (b, pose_b, -1.0)
    planes = [
        sign * pose.rotation @ own.rotation @ shape.normal
        for side, pose, sign in sides
        for shape, own in side.pieces
        if isinstance(shape, HalfSpace)
    ]
    axes = [_DIRECTIONS @ pose.rotation.T for _, pose, _ in sides]
    directions = np.concatenate([normal[None], *axes, np.reshape(planes, (-1, 3))])
    if a.is_planar:
        directions = directions[directions[:, 2] == 0.0]
    ends = _reach(a.pieces, directions @ pose_a.rotation) - directions @ (pose_b.position - pose_a.position)
    return float((ends + _reach(b.pieces, -directions @ pose_b.rotation)).min())


def _reach(pieces: PosedShapes, directions: Array) -> Array:
    """How far an object reaches in directions (n, 3) in its own frame (m)."""
    shape, pose = pieces[0]
    tree = shape_tree(shape) if len(pieces) == 1 and isinstance(shape, Mesh | Points) else None
    if tree is None:
        return reach(pieces, directions)
    radius = shape.radius if isinstance(shape, Points) else 0.0
    return tree_extents(tree, directions @ pose.rotation) + directions @ pose.position + radius
