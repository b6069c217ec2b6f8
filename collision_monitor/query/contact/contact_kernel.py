"""The contact of two objects of the library, in one call of a kernel: `chains_contact`, as the monitor's."""

from __future__ import annotations

import threading
from math import inf
from typing import Final

import numpy as np
from numpy.typing import NDArray

from collision_monitor._jit import device, kernel
from collision_monitor._jit.settled import settled
from collision_monitor.impact.body_contact import RESULT, chains_contact
from collision_monitor.impact.body_impact import Scratch, make_scratch
from collision_monitor.motion.bodies import Parts
from collision_monitor.motion.motion import quaternion_to_matrix
from collision_monitor.narrow_phase.contact_row import BOUND, DISTANCE, NORMAL, POINT_A, POINT_B
from collision_monitor.narrow_phase.pair_pose import PairPose
from collision_monitor.query.library import LIBRARY
from collision_monitor.shapes.pose import Pose
from collision_monitor.shapes.shape_table import ShapeTable

Array = NDArray[np.float64]


class QueryMemory(threading.local):
    """Scratch memory of each thread."""

    def __init__(self) -> None:
        self.scratch = tuple(make_scratch())


MEMORY: Final = QueryMemory()

# The arrays of a table cost 20 ns each as arguments, and 200 ns in a named tuple, so each kernel takes them one by one:
# those of ShapeTable, of Parts and of Scratch.


@device
def _contact(table, parts, a, x_a, i, b, x_b, j, limit, effort, scratch, row):
    """Write the contact of two chains at the poses x_a[i] and x_b[j], with points in the world; return the distance."""
    R_a, R_b = scratch.rotation[0], scratch.rotation[1]
    quaternion_to_matrix(x_a[:, 3:7], i, R_a)
    quaternion_to_matrix(x_b[:, 3:7], j, R_b)
    p = (x_b[j, 0] - x_a[i, 0], x_b[j, 1] - x_a[i, 1], x_b[j, 2] - x_a[i, 2])
    row[DISTANCE] = inf
    best, _ = chains_contact(table, parts, a, b, PairPose(R_a, R_b, p), limit, effort, scratch, row)
    if best < inf:
        for c in range(3):
            row[POINT_A + c] += x_a[i, c]
            row[POINT_B + c] = row[POINT_A + c] + row[DISTANCE] * row[NORMAL + c]
    return best


@settled
@kernel
def contact_of_chains(
    kind, size, margin, radius, vertex_start, vertex_count, vertices, vertex_index, local_position, local_rotation,
    blocks, next_part, index, placed, rotation, quaternion, out, work, tree, answer, triangle,
    a, ax, ay, az, ai, aj, ak, aw, b, bx, by, bz, bi, bj, bk, bw, limit, effort, row,
):  # fmt: skip
    """Write the contact of two chains of slots to a row (RESULT,); return the distance and its bound (m).

    A pose is x, y, z and a unit quaternion. The distance is infinite, without a contact, beyond the limit (m).
    """
    table = ShapeTable(
        kind, size, margin, radius, vertex_start, vertex_count, vertices, vertex_index, local_position, local_rotation,
        blocks,
    )  # fmt: skip
    parts = Parts(next_part, index, placed)
    scratch = Scratch(rotation, quaternion, out, work, tree, answer, triangle)
    quaternion[0, 0], quaternion[0, 1], quaternion[0, 2], quaternion[0, 3] = ai, aj, ak, aw
    quaternion_to_matrix(quaternion, 0, rotation[0])
    quaternion[0, 0], quaternion[0, 1], quaternion[0, 2], quaternion[0, 3] = bi, bj, bk, bw
    quaternion_to_matrix(quaternion, 0, rotation[1])
    pose = PairPose(rotation[0], rotation[1], (bx - ax, by - ay, bz - az))
    first, second = np.int32(a), np.int32(b)
    row[BOUND] = inf
    best, _ = chains_contact(table, parts, first, second, pose, limit, effort, scratch, row)
    if best < inf:
        at = ax, ay, az
        for c in range(3):
            row[POINT_A + c] += at[c]
            row[POINT_B + c] = row[POINT_A + c] + row[DISTANCE] * row[NORMAL + c]
    return best, row[BOUND]


def contact_row(a: int, pose_a: Pose, b: int, pose_b: Pose, effort: int, limit: float = inf) -> tuple[float, float, Array]:
    """Signed distance, its bound (m), and the contact row of two chains of the library, with points in the world."""
    row = np.empty(RESULT)
    distance, bound = contact_of_chains.entry(
        *LIBRARY.arrays, *MEMORY.scratch, a, *pose_a.numbers, b, *pose_b.numbers, limit, effort, row
    )
    return distance, bound, row
