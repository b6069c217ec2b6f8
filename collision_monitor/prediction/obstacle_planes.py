"""The configuration-space obstacle of two moving convex shapes: planes that B's position relative to A crosses.

The shapes touch where their relative position lies in the Minkowski sum of A and -B. Each direction n gives a plane
that bounds it: the gap along n is n . p - h_A(n) - h_B(-n), with the support functions h. Over a short time the gap is
linear in time. A normal that turns with one of the bodies goes on bounding a face that turns.
"""

from __future__ import annotations

from typing import Any, Final, NamedTuple

import numpy as np

from collision_monitor._jit import device, inlined
from collision_monitor.geometry.shape_table import HALF_SPACE
from collision_monitor.narrow_phase.core import rounding
from collision_monitor.narrow_phase.dispatch import separation
from collision_monitor.narrow_phase.pair_pose import PairPose
from collision_monitor.narrow_phase.support_value import core_support
from collision_monitor.prediction.bodies import place_shape
from collision_monitor.prediction.motion import relative_position, rotation_at

MOST_SEGMENTS: Final = 16
"""Largest number of parts of the time. In each part, the gaps are linear in time."""

MOST_PLANES: Final = 64
"""Largest number of planes in a segment. Each costs 1 to 2 ns per sample."""

GAP, RATE, PLANE_SIZE = 3, 4, 5
"""Columns of a plane, after its normal: gap (m) at time 0 and its rate (m/s) for the stated motion."""

AT_REST: Final = 2
"""Mode of a plane: its normal does not turn. 0 and 1: it turns with the first or the second body."""


class Obstacle(NamedTuple):
    """The planes of one pair of shapes; scratch memory of one thread. Node k is the begin of segment k."""

    planes: Any  # (MOST_SEGMENTS, MOST_PLANES, PLANE_SIZE)
    placed: Any  # (2, 3, 3): rotation of both shapes where a plane is sought
    count: Any  # (MOST_SEGMENTS,) int64: planes of each segment
    time: Any  # (MOST_SEGMENTS + 1,): of the nodes (s)
    position: Any  # (MOST_SEGMENTS + 1, 3): of body B relative to body A (m)
    rotation: Any  # (MOST_SEGMENTS + 1, 2, 3, 3): of the shapes
    offset: Any  # (MOST_SEGMENTS + 1, 2, 3): of the shapes from their bodies, in world axes (m)


def make_obstacle() -> Obstacle:
    """Make the scratch memory of one thread."""
    nodes = MOST_SEGMENTS + 1
    return Obstacle(
        np.zeros((MOST_SEGMENTS, MOST_PLANES, PLANE_SIZE)),
        np.zeros((2, 3, 3)),
        np.zeros(MOST_SEGMENTS, np.int64),
        np.zeros(nodes),
        np.zeros((nodes, 3)),
        np.zeros((nodes, 2, 3, 3)),
        np.zeros((nodes, 2, 3)),
    )


@device
def set_nodes(table, parts, pair, window, segments, scratch, obstacle):
    """Divide the window into segments without planes, and place the shapes of the pair (ShapePair) at their ends."""
    A, B, a, b = pair
    R_i, R_j = scratch.rotation[0], scratch.rotation[1]
    begin, end = window
    for k in range(segments + 1):
        t = begin + (end - begin) * k / segments
        obstacle.time[k] = t
        rotation_at(A, t, R_i)
        rotation_at(B, t, R_j)
        p, offset = relative_position(A, B, t), obstacle.offset[k]
        oa = place_shape(table, parts, a, R_i, obstacle.rotation[k, 0])
        ob = place_shape(table, parts, b, R_j, obstacle.rotation[k, 1])
        for c in range(3):
            obstacle.position[k, c] = p[c]
            offset[0, c], offset[1, c] = oa[c], ob[c]
    for k in range(segments):
        obstacle.count[k] = 0


@inlined
def _reach(table, s, R, o, x, y, z):
    """Support value (m) about its body's origin of the core of shape s, with rotation R and offset o (3,)."""
    if table.kind[s] == HALF_SPACE:
        return table.size[s, 3]
    core = core_support(
        table, s,
        x * R[0, 0] + y * R[1, 0] + z * R[2, 0],
        x * R[0, 1] + y * R[1, 1] + z * R[2, 1],
        x * R[0, 2] + y * R[1, 2] + z * R[2, 2],
    )  # fmt: skip
    return x * o[0] + y * o[1] + z * o[2] + core


@inlined
def _turned(n, R, T):
    """Unit vector n turned from rotation T (3, 3) to rotation R (3, 3)."""
    x = n[0] * T[0, 0] + n[1] * T[1, 0] + n[2] * T[2, 0]
    y = n[0] * T[0, 1] + n[1] * T[1, 1] + n[2] * T[2, 1]
    z = n[0] * T[0, 2] + n[1] * T[1, 2] + n[2] * T[2, 2]
    return (
        R[0, 0] * x + R[0, 1] * y + R[0, 2] * z,
        R[1, 0] * x + R[1, 1] * y + R[1, 2] * z,
        R[2, 0] * x + R[2, 1] * y + R[2, 2] * z,
    )


@device
def set_plane(table, a, b, n, mode, k, t, margin, error, obstacle, plane):
    """Write the plane along n (3,), a unit vector from shape a to shape b, in segment k into plane (PLANE_SIZE,).

    It holds near the place at time t that is off the stated motion by `error` (3,). mode: AT_REST, or the body that the
    normal turns with. obstacle.placed: the shapes at t.
    """
    rounded = rounding(table, a) + rounding(table, b) + margin
    begin, length = obstacle.time[k], obstacle.time[k + 1] - obstacle.time[k]
    share = (t - begin) / length if length > 0.0 else 0.0
    first, last = obstacle.position[k], obstacle.position[k + 1]
    x = first[0] + share * (last[0] - first[0])
    y = first[1] + share * (last[1] - first[1])
    z = first[2] + share * (last[2] - first[2])
    gap_0 = gap = 0.0
    for node in range(k, k + 2):
        p, R, o, m = obstacle.position[node], obstacle.rotation[node], obstacle.offset[node], n
        if mode != AT_REST:
            m = _turned(n, R[mode], obstacle.placed[mode])
        gap_0 = gap
        gap = n[0] * (p[0] - x) + n[1] * (p[1] - y) + n[2] * (p[2] - z)
        gap += m[0] * x + m[1] * y + m[2] * z
        gap += (m[0] - n[0]) * error[0] + (m[1] - n[1]) * error[1] + (m[2] - n[2]) * error[2]
        gap -= _reach(table, a, R[0], o[0], m[0], m[1], m[2]) + rounded
        gap -= _reach(table, b, R[1], o[1], -m[0], -m[1], -m[2])
    plane[0], plane[1], plane[2] = n[0], n[1], n[2]
    plane[RATE] = (gap - gap_0) / length if length > 0.0 else 0.0
    plane[GAP] = gap_0 - begin * plane[RATE]


@device
def separation_at(table, parts, pair, t, error, obstacle, scratch):
    """Return the separation (m) of a pair of shapes at time t, with B off by `error` (3,).

    Writes its direction into scratch.out, and the rotations of the shapes into obstacle.placed.
    """
    A, B, a, b = pair
    R_i, R_j, R_a, R_b = scratch.rotation[0], scratch.rotation[1], obstacle.placed[0], obstacle.placed[1]
    rotation_at(A, t, R_i)
    rotation_at(B, t, R_j)
    oa = place_shape(table, parts, a, R_i, R_a)
    ob = place_shape(table, parts, b, R_j, R_b)
    x, y, z = relative_position(A, B, t)
    x, y, z = x + error[0], y + error[1], z + error[2]
    pose = PairPose(R_a, R_b, (x + ob[0] - oa[0], y + ob[1] - oa[1], z + ob[2] - oa[2]))
    return separation(table, a, b, pose, scratch.out, scratch.work)
