"""Gaps of many samples along a plane, to first order in their errors of orientation, as sums of a few products.

Turn a box with half axes e_k by a small rotation vector w. To first order, its support value along n is the sum of
|n . e_k + w . (e_k x n)|. An axis for which no sample changes the sign contributes a linear function of w, and so
does the rim of a cylinder unless n is close to its axis. These functions are added up once for all samples. Each other
axis costs each sample a term of its own. Samples are in single precision, see sample_gaps.py.
"""

from __future__ import annotations

from math import sqrt
from typing import Any, Final

import numpy as np
from numpy import float32
from numpy.typing import NDArray

from collision_monitor._jit import device, inlined
from collision_monitor.geometry.vector import Vector, cross
from collision_monitor.shapes.kinds.box import BOX
from collision_monitor.shapes.kinds.capsule import CAPSULE
from collision_monitor.shapes.kinds.circle import CIRCLE
from collision_monitor.shapes.kinds.cylinder import CYLINDER
from collision_monitor.shapes.kinds.sphere import SPHERE
from collision_monitor.uncertainty.samples.normal_samples import FURTHEST

STEEP: Final = 0.8
"""Length of the part of the normal across a cylinder's axis above which its rim counts as linear."""

TERMS: Final = 7
"""Largest number of rows: the linear part, then two bodies of up to three terms."""

LINEAR, ALONG, OWN, SIZE, ROUND = 0, 0, 1, 7, 8
"""Row of the linear part. Columns: value without errors; factors of the rotation vectors of A and of B (3 each); factor
of the term; 1: the term is the root of the squares of this row and the next."""

COLUMNS: Final = 9


def make_terms() -> NDArray[np.float64]:
    """Make the scratch memory of one thread."""
    return np.zeros((TERMS, COLUMNS))


@inlined
def is_linear(table: Any, s: int) -> bool:
    """Whether shape s has gaps in this form."""
    kind = table.kind[s]
    return kind == BOX or kind == CAPSULE or kind == CYLINDER or kind == SPHERE or kind == CIRCLE


@inlined
def _add(row: Any, body: int, own: bool, mode: int, turned: bool, factor: float, v: Vector) -> None:
    """Add factor times v . (w_mode - w_body) to a row: errors turn the plane with one body, and the body itself."""
    for c in range(3):
        if own:
            row[OWN + 3 * body + c] -= factor * v[c]
        if turned:
            row[OWN + 3 * mode + c] += factor * v[c]


@inlined
def _most(row: Any, node: Any) -> float:
    """Bound on the magnitude of a row's part from errors of orientation at a node (NODE)."""
    most = 0.0
    for body in range(2):
        for c in range(3):
            total = left = 0.0
            for r in range(3):
                total += row[OWN + 3 * body + r] * node.turn[body, r, c]
                left += row[OWN + 3 * body + r] * node.left[body, r, c]
            most += abs(total) + abs(left)
    return FURTHEST * most


@inlined
def _begin_term(row: Any, along: float, size: float) -> None:
    """Set a row to a value without errors, and its factor."""
    for c in range(COLUMNS):
        row[c] = 0.0
    row[ALONG], row[SIZE] = along, size


@inlined
def begin_terms(n: Vector, p: Any, reach: float, mode: int, turned: bool, terms: Any) -> int:
    """Set the linear part to the gap of points, less a reach (m). Returns 1: the number of rows in use.

    n, p (3,): stated normal, and position of B relative to A. mode, turned: see `sum_terms`.
    """
    total = terms[LINEAR]
    _begin_term(total, n[0] * p[0] + n[1] * p[1] + n[2] * p[2] - reach, 0.0)
    if turned:
        lever = cross(n, p)
        for c in range(3):
            total[OWN + 3 * mode + c] = lever[c]
    return 1


@inlined
def add_reach(
    table: Any, s: int, body: int, R: Any, o: Any, n: Vector, plane: Any, node: Any, terms: Any, count: int
) -> int:
    """Subtract the support value of shape s of a body, along n for A and -n for B, from the gap in terms[LINEAR].

    R, o: rotation of the shape, and its offset from its body's origin. plane (own, mode, turned): whether errors turn
    the body; the body with which the plane turns; whether errors turn that. Returns the number of rows in use.
    """
    own, mode, turned = plane
    total, sign = terms[LINEAR], -1.0 if body else 1.0
    total[ALONG] -= sign * (n[0] * o[0] + n[1] * o[1] + n[2] * o[2])
    _add(total, body, own, mode, turned, -sign, cross(n, o))
    kind, size = table.kind[s], table.size
    across = 0.0
    for k in range(3):
        axis = (R[0, k], R[1, k], R[2, k])
        along = n[0] * axis[0] + n[1] * axis[1] + n[2] * axis[2]
        length = 0.0
        if kind == BOX:
            length = size[s, k]
        elif k == 2 and (kind == CAPSULE or kind == CYLINDER):
            length = size[s, 1]
        elif k < 2:
            across += along * along
        if length == 0.0:
            continue
        row = terms[count]
        _begin_term(row, along, length)
        lever = cross(n, axis)
        _add(row, body, own, mode, turned, 1.0, lever)
        if abs(along) > _most(row, node):
            up = length if along > 0.0 else -length
            total[ALONG] -= up * along
            _add(total, body, own, mode, turned, -up, lever)
        else:
            count += 1
    if kind == CYLINDER or kind == CIRCLE:
        rim, is_steep = sqrt(across), sqrt(across) > STEEP
        for k in range(2):
            axis = (R[0, k], R[1, k], R[2, k])
            along = n[0] * axis[0] + n[1] * axis[1] + n[2] * axis[2]
            if is_steep:
                up = size[s, 0] * along / rim
                total[ALONG] -= up * along
                _add(total, body, own, mode, turned, -up, cross(n, axis))
            else:
                row = terms[count]
                _begin_term(row, along, size[s, 0])
                row[ROUND] = 1.0 - k
                _add(row, body, own, mode, turned, 1.0, cross(n, axis))
                count += 1
    return count


@inlined
def _project(row: Any, state: Any, first: int, last: int, out: Any) -> None:
    """Write the values of a row for samples first:last into out (last - first,)."""
    along = float32(row[ALONG])
    ax, ay, az = float32(row[OWN]), float32(row[OWN + 1]), float32(row[OWN + 2])
    bx, by, bz = float32(row[OWN + 3]), float32(row[OWN + 4]), float32(row[OWN + 5])
    turns_a, turns_b = ax != 0.0 or ay != 0.0 or az != 0.0, bx != 0.0 or by != 0.0 or bz != 0.0
    u, v, w = state[3, first:last], state[4, first:last], state[5, first:last]
    p, q, r = state[6, first:last], state[7, first:last], state[8, first:last]
    if turns_a and turns_b:
        for k in range(out.size):
            out[k] = along + (ax * u[k] + ay * v[k] + az * w[k]) + (bx * p[k] + by * q[k] + bz * r[k])
    elif turns_a:
        for k in range(out.size):
            out[k] = along + (ax * u[k] + ay * v[k] + az * w[k])
    elif turns_b:
        for k in range(out.size):
            out[k] = along + (bx * p[k] + by * q[k] + bz * r[k])
    else:
        for k in range(out.size):
            out[k] = along


@device
def sum_terms(
    n: Vector, mode: int, turned: bool, terms: Any, count: int, state: Any, first: int, last: int, local: Any,
    gap: Any,
) -> None:  # fmt: skip
    """Write the gaps of samples first:last along the plane n (3,) into gap (last - first,).

    state (STATE, S): the samples; mode, turned: the body with which the plane turns, whether errors turn it; local
    (3, S): scratch. The plane and the relative position may both be off: their product is exact.
    """
    nx, ny, nz = float32(n[0]), float32(n[1]), float32(n[2])
    x, y, z = state[0, first:last], state[1, first:last], state[2, first:last]
    if turned:
        total, own, other = terms[LINEAR], 3 * mode, 3 - 3 * mode
        along, ax = float32(total[ALONG]), float32(total[OWN + own])
        ay, az = float32(total[OWN + own + 1]), float32(total[OWN + own + 2])
        bx, by, bz = float32(total[OWN + other]), float32(total[OWN + other + 1]), float32(total[OWN + other + 2])
        u, v, w = state[3 + own, first:last], state[4 + own, first:last], state[5 + own, first:last]
        p, q, r = state[3 + other, first:last], state[4 + other, first:last], state[5 + other, first:last]
        for k in range(gap.size):
            lever_x = ax + (ny * z[k] - nz * y[k])
            lever_y = ay + (nz * x[k] - nx * z[k])
            lever_z = az + (nx * y[k] - ny * x[k])
            stated = along + (nx * x[k] + ny * y[k] + nz * z[k])
            gap[k] = stated + (lever_x * u[k] + lever_y * v[k] + lever_z * w[k])
        if bx != 0.0 or by != 0.0 or bz != 0.0:
            for k in range(gap.size):
                gap[k] += bx * p[k] + by * q[k] + bz * r[k]
    else:
        _project(terms[LINEAR], state, first, last, gap)
        for k in range(gap.size):
            gap[k] += nx * x[k] + ny * y[k] + nz * z[k]
    one, other = local[0, first:last], local[1, first:last]
    m = 1
    while m < count:
        size = float32(terms[m, SIZE])
        _project(terms[m], state, first, last, one)
        if terms[m, ROUND] > 0.0:
            _project(terms[m + 1], state, first, last, other)
            for k in range(gap.size):
                gap[k] -= size * sqrt(one[k] * one[k] + other[k] * other[k])
            m += 2
        else:
            for k in range(gap.size):
                gap[k] -= size * abs(one[k])
            m += 1
