"""The contact of two objects of the library, in one call of a kernel: `chains_contact`, as the monitor's."""

from __future__ import annotations

import threading
from math import inf
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from collision_monitor._jit import kernel, outlined
from collision_monitor._jit.settled import settled
from collision_monitor.geometry.vector import Vector
from collision_monitor.impact.body_contact import RESULT, ROUND_OFF, chains_contact, chains_overlap
from collision_monitor.impact.body_impact import Scratch, make_scratch
from collision_monitor.motion.bodies import Parts, chain_radius
from collision_monitor.motion.motion import quaternion_to_matrix
from collision_monitor.narrow_phase.contact_row import BOUND, NORMAL, POINT_A, POINT_B
from collision_monitor.narrow_phase.pair_pose import PairPose
from collision_monitor.query.kernel_arguments import set_rotation, tables_of
from collision_monitor.query.library import LIBRARY
from collision_monitor.shapes.pose import Pose
from collision_monitor.shapes.shape_table import ShapeTable

Array = NDArray[np.float64]


class QueryMemory(threading.local):
    """Scratch memory of each thread."""

    def __init__(self) -> None:
        self.scratch = make_scratch()


MEMORY: Final = QueryMemory()


@settled
@kernel
def contact_of_chains(
    kind: Any, size: Any, margin: Any, radius: Any, vertex_start: Any, vertex_count: Any, vertices: Any,
    vertex_index: Any, local_position: Any, local_rotation: Any, blocks: Any, next_part: Any, index: Any, placed: Any,
    rotation: Any, quaternion: Any, out: Any, work: Any, tree: Any, answer: Any, triangle: Any, piece: Any, a: int,
    ax: float, ay: float, az: float, ai: float, aj: float, ak: float, aw: float, b: int, bx: float, by: float,
    bz: float, bi: float, bj: float, bk: float, bw: float, limit: float, effort: int, row: Any,
) -> tuple[float, float]:  # fmt: skip
    """Write the contact of two chains of slots to a row (RESULT,); return the distance and its bound (m).

    A pose is x, y, z and a unit quaternion. The distance is infinite, without a contact, beyond the limit (m).
    """
    table, parts, scratch = tables_of(
        kind, size, margin, radius, vertex_start, vertex_count, vertices, vertex_index, local_position, local_rotation,
        blocks, next_part, index, placed, rotation, quaternion, out, work, tree, answer, triangle, piece,
    )  # fmt: skip
    set_rotation(scratch, ai, aj, ak, aw, rotation[0])
    set_rotation(scratch, bi, bj, bk, bw, rotation[1])
    p = bx - ax, by - ay, bz - az
    return placed_contact(table, parts, (np.int32(a), np.int32(b)), (ax, ay, az), p, limit, effort, scratch, row)


@kernel
def contacts_of_chains(
    table: ShapeTable, parts: Parts, scratch: Scratch, firsts_a: Any, x_a: Any, firsts_b: Any, x_b: Any, effort: int,
    rows: Any,
) -> None:  # fmt: skip
    """Write the contacts of N pairs to rows (N, RESULT). firsts (N,) or (1,): slots; x (N, 7) or (1, 7): poses.

    A negative slot leaves its pair out.
    """
    R = scratch.rotation
    for k in range(len(rows)):
        i, j = min(k, len(x_a) - 1), min(k, len(x_b) - 1)
        chains = firsts_a[min(k, len(firsts_a) - 1)], firsts_b[min(k, len(firsts_b) - 1)]
        if chains[0] >= 0 and chains[1] >= 0:
            quaternion_to_matrix(x_a[:, 3:7], i, R[0])
            quaternion_to_matrix(x_b[:, 3:7], j, R[1])
            origin = x_a[i, 0], x_a[i, 1], x_a[i, 2]
            p = x_b[j, 0] - origin[0], x_b[j, 1] - origin[1], x_b[j, 2] - origin[2]
            placed_contact(table, parts, chains, origin, p, inf, effort, scratch, rows[k])


@outlined
def placed_contact(
    table: ShapeTable, parts: Parts, chains: Any, origin: Vector, p: Vector, limit: float, effort: int,
    scratch: Scratch, row: Any,
) -> tuple[float, float]:  # fmt: skip
    """Write the contact of two chains (first slots) to a row, with points in the world; return distance and bound (m).

    origin, p: position of the first one, and of the second one relative to it. Their rotations are in the scratch.
    """
    row[BOUND] = inf
    pose = PairPose(scratch.rotation[0], scratch.rotation[1], p)
    best, _ = chains_contact(table, parts, chains[0], chains[1], pose, limit, effort, scratch, row)
    if best < inf:
        for c in range(3):
            row[POINT_A + c] += origin[c]
            row[POINT_B + c] = row[POINT_A + c]
            if best > -inf:  # else no translation parts two half-spaces
                row[POINT_B + c] += best * row[NORMAL + c]
    return best, row[BOUND]


@settled
@kernel
def overlap_of_chains(
    kind: Any, size: Any, margin: Any, radius: Any, vertex_start: Any, vertex_count: Any, vertices: Any,
    vertex_index: Any, local_position: Any, local_rotation: Any, blocks: Any, next_part: Any, index: Any, placed: Any,
    rotation: Any, quaternion: Any, out: Any, work: Any, tree: Any, answer: Any, triangle: Any, piece: Any, a: int,
    ax: float, ay: float, az: float, ai: float, aj: float, ak: float, aw: float, b: int, bx: float, by: float,
    bz: float, bi: float, bj: float, bk: float, bw: float,
) -> bool:  # fmt: skip
    """Whether two chains of slots have a point in common. Arguments as for `contact_of_chains`."""
    table, parts, scratch = tables_of(
        kind, size, margin, radius, vertex_start, vertex_count, vertices, vertex_index, local_position, local_rotation,
        blocks, next_part, index, placed, rotation, quaternion, out, work, tree, answer, triangle, piece,
    )  # fmt: skip
    p, reach = (bx - ax, by - ay, bz - az), chain_radius(table, parts, a) + chain_radius(table, parts, b)
    if p[0] * p[0] + p[1] * p[1] + p[2] * p[2] > reach * reach * ROUND_OFF:
        return False
    set_rotation(scratch, ai, aj, ak, aw, rotation[0])
    set_rotation(scratch, bi, bj, bk, bw, rotation[1])
    return chains_overlap(table, parts, np.int32(a), np.int32(b), PairPose(rotation[0], rotation[1], p), scratch)


def contact_row(
    a: int, pose_a: Pose, b: int, pose_b: Pose, effort: int, limit: float = inf
) -> tuple[float, float, Array]:
    """Signed distance, its bound (m), and the contact row of two chains of the library, with points in the world."""
    row = np.empty(RESULT)
    distance, bound = contact_of_chains.entry(
        *LIBRARY.arrays, *MEMORY.scratch, a, *pose_a.numbers, b, *pose_b.numbers, limit, effort, row
    )
    return distance, bound, row


def have_common_point(a: int, pose_a: Pose, b: int, pose_b: Pose) -> bool:
    """Whether two chains of the library overlap or touch; of an open mesh its surface."""
    return bool(overlap_of_chains.entry(*LIBRARY.arrays, *MEMORY.scratch, a, *pose_a.numbers, b, *pose_b.numbers))
