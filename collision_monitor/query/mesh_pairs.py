"""The contact and the overlap of a mesh and another shape with a tree, each in one call of a kernel."""

from __future__ import annotations

import threading
from math import inf
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from collision_monitor._jit import inlined, kernel
from collision_monitor.geometry.shapes import Shape
from collision_monitor.meshes.contact import APART, tree_contact
from collision_monitor.meshes.inside import OUTSIDE, is_in
from collision_monitor.meshes.nearest import MEMORY, PLACE_A, PLACE_B, answer_row
from collision_monitor.meshes.placing import inverse, relative
from collision_monitor.meshes.shape_trees import trees_of_pair
from collision_monitor.meshes.touching import touching
from collision_monitor.narrow_phase.contact_row import BOUND, CONTACT_SIZE, DISTANCE, POINT_A, POINT_B
from collision_monitor.narrow_phase.pair_pose import PairPose
from collision_monitor.prediction.motion import quaternion_to_matrix
from collision_monitor.query.packed import packed_pose

Array = NDArray[np.float64]


class _Memory(threading.local):
    """Scratch memory of each thread."""

    def __init__(self) -> None:
        self.rotation = np.zeros((2, 3, 3))
        self.answer = answer_row()
        self.work = np.empty(MEMORY)


_MEMORY: Final = _Memory()


def _trees_and_poses(shape_a: Any, pose_a: Any, shape_b: Any, pose_b: Any) -> tuple[Array, Array, Array, Array] | None:
    """Trees and packed poses of two shapes, of an open mesh its surface; None for others."""
    if not (isinstance(shape_a, Shape) and isinstance(shape_b, Shape)):
        return None
    trees = trees_of_pair(shape_a, shape_b, surface=True)
    if trees is None:
        return None
    try:
        return trees[0], pose_a.packed_pose, trees[1], pose_b.packed_pose
    except AttributeError:
        x_a, x_b = packed_pose(pose_a), packed_pose(pose_b)
        return None if x_a is None or x_b is None else (trees[0], x_a, trees[1], x_b)


def mesh_overlap(shape_a: Any, pose_a: Any, shape_b: Any, pose_b: Any) -> bool | None:
    """Whether two shapes overlap or touch; of an open mesh its surface. None for a pair without trees or a mesh."""
    found = _trees_and_poses(shape_a, pose_a, shape_b, pose_b)
    return None if found is None else trees_overlap(*found, _MEMORY.rotation, _MEMORY.work)


def mesh_contact(shape_a: Any, pose_a: Any, shape_b: Any, pose_b: Any) -> tuple[float, float, Array] | None:
    """Distance of two surfaces that are apart, its round-off (m), and their contact row, with points in the world.

    None for other pairs than `mesh_overlap` takes, and for those that may overlap.
    """
    found = _trees_and_poses(shape_a, pose_a, shape_b, pose_b)
    if found is None:
        return None
    row = np.empty(CONTACT_SIZE)
    if trees_contact(*found, _MEMORY.rotation, _MEMORY.answer, _MEMORY.work, row) != APART:
        return None
    return float(row[DISTANCE]), float(row[BOUND]), row


@inlined
def _place(pose_a: Any, pose_b: Any, R: Any) -> tuple[float, float, float]:
    """Write the rotations of packed poses (1, 7) to R (2, 3, 3); return the position of B relative to A (m)."""
    quaternion_to_matrix(pose_a[:, 3:], 0, R[0])
    quaternion_to_matrix(pose_b[:, 3:], 0, R[1])
    return pose_b[0, 0] - pose_a[0, 0], pose_b[0, 1] - pose_a[0, 1], pose_b[0, 2] - pose_a[0, 2]


@kernel
def trees_overlap(tree_a: Any, pose_a: Any, tree_b: Any, pose_b: Any, R: Any, work: Any) -> bool:
    """Whether two trees have a point in common, on a surface or in a solid, or may have one if it takes too long.

    pose_a, pose_b (1, 7): position (m) and unit quaternion (x, y, z, w). Scratch memory: R (2, 3, 3), work (MEMORY,).
    """
    p = _place(pose_a, pose_b, R)
    X = relative(R[0], R[1], p)
    if not touching(tree_a, 0, tree_b, 0, X, 1, work)[1]:
        return True
    if is_in(tree_a, 0, tree_b, 0, X, 0.0, work) != OUTSIDE:
        return True
    return is_in(tree_b, 0, tree_a, 0, inverse(X), 0.0, work) != OUTSIDE


@kernel
def trees_contact(
    tree_a: Any, pose_a: Any, tree_b: Any, pose_b: Any, R: Any, answer: Any, work: Any, row: Any
) -> int:
    """`tree_contact` of two trees placed as in `trees_overlap`, with points in the world. answer (ANSWER,)."""
    p = _place(pose_a, pose_b, R)
    answer[PLACE_A] = answer[PLACE_B] = -1.0
    known = tree_contact(tree_a, 0, tree_b, 0, PairPose(R[0], R[1], p), inf, row, answer, work)
    for c in range(3):
        row[POINT_A + c] += pose_a[0, c]
        row[POINT_B + c] += pose_a[0, c]
    return known
