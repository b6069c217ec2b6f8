"""The contact and the overlap of a mesh and another shape with a tree, each in one call of a kernel."""

from __future__ import annotations

import threading
from math import dist, inf
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from collision_monitor._jit import inlined, kernel
from collision_monitor._jit.settled import settled
from collision_monitor.meshes.boxes import box_separations
from collision_monitor.meshes.distance.contact import APART, tree_contact
from collision_monitor.meshes.distance.nearest import ANSWER, BOUNDS, MEMORY, PLACE_A, PLACE_B
from collision_monitor.meshes.overlap.inside import OUTSIDE, is_either_in
from collision_monitor.meshes.overlap.touching_triangles import touching_triangles
from collision_monitor.meshes.placing import relative
from collision_monitor.meshes.trees.shape_trees import CERTAIN, NEVER, KeptTree, have_kernels, kept_tree
from collision_monitor.motion.motion import quaternion_to_matrix
from collision_monitor.narrow_phase.contact_row import BOUND, CONTACT_SIZE, DISTANCE, POINT_A, POINT_B
from collision_monitor.narrow_phase.pair_pose import PairPose
from collision_monitor.query.packed import packed_pose
from collision_monitor.shapes.pose import Pose
from collision_monitor.shapes.registry import Shape
from collision_monitor.tolerances import EPSILON

Array = NDArray[np.float64]


_ROTATIONS: Final = MEMORY
_ANSWER: Final = _ROTATIONS + 18
_MEMORY: Final = _ANSWER + ANSWER
"""Parts of the scratch memory: a query, both rotations (2, 3, 3) to world axes, the answer of `nearest_triangles`."""

_ROUNDED_UP: Final = 1.0 + 8.0 * EPSILON


def query_memory() -> Array:
    """Make scratch memory for the kernels of this module."""
    return np.empty(_MEMORY)


class _Memory(threading.local):
    """Scratch memory of each thread."""

    def __init__(self) -> None:
        self.work = query_memory()


_OWN: Final = _Memory()


def _packed(shape_a: Any, pose_a: Any, shape_b: Any, pose_b: Any) -> tuple[KeptTree, Array, KeptTree, Array] | None:
    """Trees and packed poses of two shapes; None for other arguments."""
    try:
        return shape_a.kept_tree, pose_a.packed_pose, shape_b.kept_tree, pose_b.packed_pose
    except AttributeError:  # not made yet
        if not (isinstance(shape_a, Shape) and isinstance(shape_b, Shape)):
            return None
        x_a, x_b = packed_pose(pose_a), packed_pose(pose_b)
        if x_a is None or x_b is None:
            return None
        return kept_tree(shape_a), x_a, kept_tree(shape_b), x_b


def mesh_overlap(shape_a: Any, pose_a: Any, shape_b: Any, pose_b: Any) -> bool | None:
    """Whether two shapes overlap or touch; of an open mesh its surface. None for a pair without trees or a mesh."""
    found = _packed(shape_a, pose_a, shape_b, pose_b)
    if found is None:
        return None
    a, x_a, b, x_b = found
    if dist(pose_a.point, pose_b.point) > (a.reach + b.reach) * _ROUNDED_UP:
        return False
    if not have_kernels(a, b, NEVER):
        return None
    meet: bool = packed_trees_overlap.entry(a.tree, x_a, b.tree, x_b, _OWN.work)
    return meet


def boxes_apart(shape_a: Shape, pose_a: Pose, shape_b: Shape, pose_b: Pose) -> bool:
    """Whether the boxes around two shapes with trees are certainly apart. False for shapes without a tree."""
    a, b = kept_tree(shape_a).tree, kept_tree(shape_b).tree
    x_a, x_b = packed_pose(pose_a), packed_pose(pose_b)
    if a is None or b is None or x_a is None or x_b is None:
        return False
    return bool(roots_apart.entry(a, x_a, b, x_b, _OWN.work))


def mesh_contact(shape_a: Any, pose_a: Any, shape_b: Any, pose_b: Any) -> tuple[float, float | None, Array] | None:
    """Distance of two surfaces that are apart, its bound (m), and their contact row, with points in the world.

    The bound is None if the inside of a mesh is not certain. The result is None for other pairs than `mesh_overlap`
    takes, and for those that may overlap.
    """
    found = _packed(shape_a, pose_a, shape_b, pose_b)
    if found is None or not have_kernels(found[0], found[2], NEVER):
        return None
    a, x_a, b, x_b = found
    row = np.empty(CONTACT_SIZE)
    distance, bound = trees_contact.entry(a.tree, x_a, b.tree, x_b, _OWN.work, row)
    if bound < 0.0:
        return None
    return distance, bound if a.inside == b.inside == CERTAIN else None, row


@inlined
def _place(pose_a: Any, pose_b: Any, R: Any) -> tuple[float, float, float]:
    """Write the rotations of packed poses (1, 7) to R (2, 3, 3); return the position of B relative to A (m)."""
    quaternion_to_matrix(pose_a[:, 3:], 0, R[0])
    quaternion_to_matrix(pose_b[:, 3:], 0, R[1])
    return pose_b[0, 0] - pose_a[0, 0], pose_b[0, 1] - pose_a[0, 1], pose_b[0, 2] - pose_a[0, 2]


@settled
@kernel
def roots_apart(tree_a: Any, pose_a: Any, tree_b: Any, pose_b: Any, memory: Any) -> bool:
    """Whether the boxes of two whole trees, placed as in `packed_trees_overlap`, are apart."""
    R = memory[_ROTATIONS:_ANSWER].reshape((2, 3, 3))
    p = _place(pose_a, pose_b, R)
    box_separations(tree_a, 0, 0, tree_b, 0, relative(R[0], R[1], p), memory, BOUNDS)
    return memory[BOUNDS] > 0.0


@settled
@kernel
def packed_trees_overlap(tree_a: Any, pose_a: Any, tree_b: Any, pose_b: Any, memory: Any) -> bool:
    """Whether two trees have a point in common, on a surface or in a solid, or may have one if it takes too long.

    pose_a, pose_b (1, 7): position (m) and unit quaternion (x, y, z, w). memory: of `query_memory`.
    """
    R = memory[_ROTATIONS:_ANSWER].reshape((2, 3, 3))
    p = _place(pose_a, pose_b, R)
    X = relative(R[0], R[1], p)
    if not touching_triangles(tree_a, 0, tree_b, 0, X, 1, memory)[1]:
        return True
    return is_either_in(tree_a, 0, tree_b, 0, X, 0.0, memory) != OUTSIDE


@settled
@kernel
def trees_contact(tree_a: Any, pose_a: Any, tree_b: Any, pose_b: Any, memory: Any, row: Any) -> tuple[float, float]:
    """`tree_contact` of two trees placed as in `packed_trees_overlap`, with points in the world.

    Return the distance and its bound (m), a bound below 0 if they are not certainly apart.
    """
    R, answer = memory[_ROTATIONS:_ANSWER].reshape((2, 3, 3)), memory[_ANSWER:]
    p = _place(pose_a, pose_b, R)
    answer[PLACE_A] = answer[PLACE_B] = -1.0
    known = tree_contact(tree_a, 0, tree_b, 0, PairPose(R[0], R[1], p), inf, row, answer, memory)
    for c in range(3):
        row[POINT_A + c] += pose_a[0, c]
        row[POINT_B + c] += pose_a[0, c]
    return row[DISTANCE], row[BOUND] if known == APART else -1.0
