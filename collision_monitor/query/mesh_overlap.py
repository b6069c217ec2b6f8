"""Whether a mesh and another shape with a tree overlap, in one call of a kernel."""

from __future__ import annotations

import threading
from typing import Any, Final

import numpy as np

from collision_monitor._jit import kernel
from collision_monitor.geometry.shapes import Shape
from collision_monitor.meshes.inside import OUTSIDE, is_in
from collision_monitor.meshes.nearest import MEMORY, PAIRS
from collision_monitor.meshes.placing import inverse, relative
from collision_monitor.meshes.shape_trees import trees_of_pair
from collision_monitor.meshes.touching import touching
from collision_monitor.prediction.motion import quaternion_to_matrix
from collision_monitor.query.packed import packed_pose


class _Memory(threading.local):
    """Scratch memory of each thread."""

    def __init__(self) -> None:
        self.work = np.empty(MEMORY)


_MEMORY: Final = _Memory()


def mesh_overlap(shape_a: Any, pose_a: Any, shape_b: Any, pose_b: Any) -> bool | None:
    """Whether two shapes overlap or touch; of an open mesh its surface. None for a pair without trees or a mesh."""
    if not (isinstance(shape_a, Shape) and isinstance(shape_b, Shape)):
        return None
    trees = trees_of_pair(shape_a, shape_b, surface=True)
    if trees is None:
        return None
    try:
        x_a, x_b = pose_a.packed_pose, pose_b.packed_pose
    except AttributeError:
        x_a, x_b = packed_pose(pose_a), packed_pose(pose_b)
        if x_a is None or x_b is None:
            return None
    return trees_overlap(trees[0], x_a, trees[1], x_b, _MEMORY.work)


@kernel
def trees_overlap(tree_a: Any, pose_a: Any, tree_b: Any, pose_b: Any, work: Any) -> bool:
    """Whether two trees have a point in common, on a surface or in a solid.

    pose_a, pose_b (1, 7): position (m) and unit quaternion (x, y, z, w). work (MEMORY,).
    """
    R = work[PAIRS : PAIRS + 18].reshape((2, 3, 3))
    quaternion_to_matrix(pose_a[:, 3:], 0, R[0])
    quaternion_to_matrix(pose_b[:, 3:], 0, R[1])
    p = pose_b[0, 0] - pose_a[0, 0], pose_b[0, 1] - pose_a[0, 1], pose_b[0, 2] - pose_a[0, 2]
    X = relative(R[0], R[1], p)
    if touching(tree_a, 0, tree_b, 0, X, 1, work)[0] > 0:
        return True
    if is_in(tree_a, 0, tree_b, 0, X, 0.0, work) != OUTSIDE:
        return True
    return is_in(tree_b, 0, tree_a, 0, inverse(X), 0.0, work) != OUTSIDE
