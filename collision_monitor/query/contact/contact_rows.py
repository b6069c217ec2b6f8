"""Contacts of pairs of convex solids, packed as rows of numbers."""

from __future__ import annotations

import numpy as np

from collision_monitor._jit import kernel, outlined
from collision_monitor._jit.settled import settled
from collision_monitor.motion.motion import quaternion_to_matrix
from collision_monitor.narrow_phase.contact_row import BOUND, DISTANCE, NORMAL, POINT_A, POINT_B
from collision_monitor.narrow_phase.dispatch import pair_contact
from collision_monitor.narrow_phase.pair_pose import PairPose
from collision_monitor.query.packed import fits, load_pair


@outlined
def write_contact(a, at_a, x_a, i, b, at_b, x_b, j, memory, row):
    """Write the contact of the pair at a[at_a], with pose x_a[i], and b[at_b], with pose x_b[j]."""
    table, R, work = load_pair(memory, a, at_a, b, at_b)
    quaternion_to_matrix(x_a[:, 3:7], i, R[0])
    quaternion_to_matrix(x_b[:, 3:7], j, R[1])
    p = (x_b[j, 0] - x_a[i, 0], x_b[j, 1] - x_a[i, 1], x_b[j, 2] - x_a[i, 2])
    first, second = np.int32(0), np.int32(1)  # the type of a slot in the other kernels, which thus share the pair test
    pair_contact(table, first, second, PairPose(R[0], R[1], p), row, work)
    for c in range(3):
        row[POINT_A + c] += x_a[i, c]
        row[POINT_B + c] = row[POINT_A + c] + row[DISTANCE] * row[NORMAL + c]


@settled
@kernel
def contact_row(a, x_a, b, x_b, memory, row):
    """Write the contact of two packed shapes to a row (CONTACT_SIZE,), with the points in the world frame.

    x_a, x_b (1, 7): their poses. Return the signed distance and its bound (m); (0, -1), without a contact, if the
    memory is too small.
    """
    if not fits(memory, a, 0, b, 0):
        return 0.0, -1.0
    write_contact(a, 0, x_a, 0, b, 0, x_b, 0, memory, row)
    return row[DISTANCE], row[BOUND]


@kernel
def contact_rows(a, at_a, x_a, b, at_b, x_b, memory, rows):
    """Write the contacts of N pairs to rows (N, CONTACT_SIZE), as `contact_row` does.

    a, b: packed shapes one after the other; at_a, at_b (N,) or (1,): where those of a pair begin; poses (N, 7), (1, 7).
    """
    for k in range(len(rows)):
        i, j = min(k, len(x_a) - 1), min(k, len(x_b) - 1)
        write_contact(a, at_a[min(k, len(at_a) - 1)], x_a, i, b, at_b[min(k, len(at_b) - 1)], x_b, j, memory, rows[k])
