"""First impacts of two bodies in many motions, given as rows of numbers and not laid out as many bodies."""

from __future__ import annotations

from math import inf, sqrt
from typing import Any, Final, NamedTuple

import numpy as np

from collision_monitor._jit import device, kernel
from collision_monitor.impact.body_impact import Window, body_impact
from collision_monitor.impact.impact_record import CLEAR, HIT
from collision_monitor.motion.motion import quaternion_to_matrix
from collision_monitor.tolerances import EPSILON, LARGEST_INPUT, UNIT_QUATERNION

_SMALLEST: Final = 1e-240
"""m^4/s^2, as in sphere_interval.py: products of squared lengths and speeds below it lose digits."""


class ImpactTimes(NamedTuple):
    """Times of impact of N motions."""

    lower: Any  # (N,) s
    upper: Any  # (N,) s
    left: Any  # (N,) bool: undecided


@kernel
def normalise_states(state):
    """Normalise the quaternions of states (N, 13) in place.

    Return the first row that is no valid state, or -1, and the length of its quaternion if that is the reason, else -1.
    """
    for k in range(len(state)):
        for column in range(13):
            if not abs(state[k, column]) <= LARGEST_INPUT:
                return k, -1.0
        x, y, z, w = state[k, 3], state[k, 4], state[k, 5], state[k, 6]
        norm = sqrt(x * x + y * y + z * z + w * w)
        if not abs(norm - 1.0) <= UNIT_QUATERNION:
            return k, norm
        for column in range(3, 7):
            state[k, column] /= norm
    return -1, -1.0


@device
def _set_motion(motion, state, k):
    motion.x, motion.y, motion.z = state[k, 0], state[k, 1], state[k, 2]
    motion.vx, motion.vy, motion.vz = state[k, 7], state[k, 8], state[k, 9]
    motion.wx, motion.wy, motion.wz = state[k, 10], state[k, 11], state[k, 12]


@kernel
def impacts_of_rows(multibody, states, rows, horizon, queries, memory, times):
    """Compute the first impacts of two bodies that move as in `rows` of the states, two arrays (N, 13).

    Other rows of `times` keep their values. queries: the ImpactQuery, and one that finds overlaps deeper than touching
    at the start, which are impacts at 0. times.left marks motions that touch at the start, which stay undecided.
    memory: Scratch, and an array of one IMPACT.
    """
    bodies = multibody.bodies
    state_a, state_b = states
    query, deep = queries
    scratch, event = memory
    lower, upper, left = times
    window = Window(0.0, horizon)
    first, second = np.int32(0), np.int32(1)  # the type of a slot in the other kernels, which thus share the code
    q_a, q_b = state_a[:, 3:7], state_b[:, 3:7]
    for r in range(len(rows)):
        k = rows[r]
        _set_motion(bodies.motion[0], state_a, k)
        _set_motion(bodies.motion[1], state_b, k)
        quaternion_to_matrix(q_a, k, bodies.motion[0].rotation)
        quaternion_to_matrix(q_b, k, bodies.motion[1].rotation)
        body_impact(multibody, first, second, window, query, scratch, event[0])
        lower[k] = upper[k] = inf
        left[k] = False
        if event[0].status == CLEAR:
            continue
        lower[k] = event[0].lower
        if event[0].status == HIT and event[0].upper <= horizon:
            upper[k] = event[0].upper
        if lower[k] <= 0.0:
            body_impact(multibody, first, second, window, deep, scratch, event[0])
            if event[0].status == HIT and event[0].upper <= 0.0:
                upper[k] = 0.0
            else:
                left[k] = True


@kernel
def impacts_of_spheres(a, b, reach, horizon, times):
    """Compute the first impacts of spheres with radii that add up to `reach` (m); a, b: states as columns (13, N).

    The closed form is that of `sphere_interval`, but without branches, so that the processor computes eight motions at
    once: the first root c / (-b + sqrt(D)), rounded outward for lower and inward for upper. times.left marks motions
    that touch at the start, graze or underflow, which stay undecided.
    """
    lower, upper, left = times
    certain = reach * (1.0 - 8.0 * EPSILON)  # the radii are rounded up by nearly as much
    outer, inner = reach * reach, certain * certain
    for k in range(len(lower)):
        dx, dy, dz = b[0, k] - a[0, k], b[1, k] - a[1, k], b[2, k] - a[2, k]
        vx, vy, vz = b[7, k] - a[7, k], b[8, k] - a[8, k], b[9, k] - a[9, k]
        ox, oy, oz = dy * vz - dz * vy, dz * vx - dx * vz, dx * vy - dy * vx
        pp, vv, far = dx * dx + dy * dy + dz * dz, vx * vx + vy * vy + vz * vz, ox * ox + oy * oy + oz * oz
        size, closing = pp + outer, -(dx * vx + dy * vy + dz * vz)
        off = size * vv
        slack = 8.0 * EPSILON * sqrt(off)
        c = pp - outer - 4.0 * EPSILON * size
        discriminant = outer * vv - far + 32.0 * EPSILON * off
        s = sqrt(max(discriminant, 0.0)) + closing + slack
        first = c / s * (1.0 - 4.0 * EPSILON)
        may = (discriminant >= 0.0) & (s > 0.0) & (first <= horizon)
        discriminant = inner * vv - far - 32.0 * EPSILON * off
        s = sqrt(max(discriminant, 0.0)) + closing - slack
        sure = (pp - inner + 4.0 * EPSILON * size) / s * (1.0 + 4.0 * EPSILON)
        must = (discriminant >= 0.0) & (s > 0.0) & (sure <= horizon)
        lower[k] = first if may else inf
        upper[k] = sure if must else inf
        left[k] = (c <= 0.0) | (may & (not must)) | (off < _SMALLEST)
