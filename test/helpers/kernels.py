"""Kernels that call device functions of the package for the tests."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from collision_monitor._jit import kernel
from collision_monitor.meshes.distance.nearest import nearest_triangles
from collision_monitor.meshes.overlap.touching_triangles import touching_triangles
from collision_monitor.meshes.placing import relative
from collision_monitor.narrow_phase.dispatch import separation
from collision_monitor.narrow_phase.pair_pose import pair_pose
from collision_monitor.narrow_phase.work_memory import WORK_SIZE

Array = NDArray[np.float64]


@kernel
def tree_distance(
    tree_a: Any, R_a: Any, p_a: Any, tree_b: Any, R_b: Any, p_b: Any, limit: float, answer: Any, work: Any
) -> float:
    """`nearest_triangles` of two trees at poses given by rotations (3, 3) and positions (3,) (m)."""
    p = p_b[0] - p_a[0], p_b[1] - p_a[1], p_b[2] - p_a[2]
    return nearest_triangles(tree_a, 0, tree_b, 0, relative(R_a, R_b, p), limit, answer, work)


@kernel
def trees_touch(tree_a: Any, R_a: Any, p_a: Any, tree_b: Any, R_b: Any, p_b: Any, most: int, work: Any) -> Any:
    """`touching_triangles` of two trees at poses given by rotations (3, 3) and positions (3,) (m)."""
    p = p_b[0] - p_a[0], p_b[1] - p_a[1], p_b[2] - p_a[2]
    return touching_triangles(tree_a, 0, tree_b, 0, relative(R_a, R_b, p), most, work)


def separation_batch(table: Any, position: Array, rotation: Array, pairs: NDArray[np.int32]) -> Array:
    """Unit directions and certified lower bounds (m) of the distances, (M, 4); arguments as in `contact_batch`."""
    out = np.zeros((len(pairs), 4))
    _separations(table, position, rotation, pairs, out, np.zeros(WORK_SIZE))
    return out


@kernel
def _separations(table: Any, position: Any, rotation: Any, pairs: Any, out: Any, work: Any) -> None:
    for k in range(len(pairs)):
        a, b = pairs[k, 0], pairs[k, 1]
        out[k, 3] = separation(table, a, b, pair_pose(position, rotation, a, b), out[k], work)
