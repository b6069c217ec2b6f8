"""The configuration-space obstacle of two moving convex shapes: planes that B's position relative to A crosses.

The shapes touch where their relative position lies in the Minkowski sum of A and -B. Each direction n gives a plane
that bounds it: the gap along n is n . p - h_A(n) - h_B(-n), with the support functions h. Over a short time the gap is
a parabola in time. A normal that turns with one of the bodies goes on bounding a face that turns.
"""

from __future__ import annotations

from math import sqrt
from typing import Any, Final, NamedTuple

import numpy as np

from collision_monitor._jit import device, inlined
from collision_monitor.geometry.vector import Vector
from collision_monitor.motion.bodies import place_shape
from collision_monitor.motion.motion import relative_position, rotation_at
from collision_monitor.motion.trigonometry import sin_cos
from collision_monitor.narrow_phase.dispatch import separation
from collision_monitor.narrow_phase.pair_pose import PairPose
from collision_monitor.uncertainty.samples.error_samples import NOT_TURNING, set_turn

MOST_SEGMENTS: Final = 48
"""Largest number of parts of the time. In each part, the gaps are parabolas in time."""

MOST_PLANES: Final = 64
"""Largest number of planes in a segment. Each costs 1 to 10 ns per sample."""

MODE, BENDS, PLANE_SIZE = 3, 4, 5
"""Columns of a plane behind its normal: mode; 1 if gaps bend in the segment, 0 if they are straight lines; number of
columns."""

AT_REST: Final = 2
"""Mode of a plane: its normal, in world axes, does not turn. 0 and 1: it turns with the first or the second shape, and
is in the axes of that shape."""


LOUD, QUIET, APART = 0, 1, 2
"""Segments: some samples of the pilot meet, none does, and none of all samples can."""

NOT_OFF: Final = (0.0, 0.0, 0.0)
"""Error of a position, or rotation vector of an error, of the stated motion."""

NO_TURNS: Final = (NOT_TURNING, NOT_TURNING)
"""Turning of two bodies without errors of orientation, see `set_nodes`."""

ABOUT_ALL: Final = (False, False)
"""Errors of orientation of neither body are about the z axis alone, see `set_nodes`."""


NODE = np.dtype(
    [
        ("time", np.float64),  # s
        ("position", np.float64, 3),  # of body B relative to body A (m)
        ("rotation", np.float64, (2, 3, 3)),  # of the shapes
        ("offset", np.float64, (2, 3)),  # of the shapes from their bodies, in world axes (m)
        ("turn", np.float64, (2, 3, 3)),  # rotation vectors of the bodies for unit errors of orientation (rad)
        ("left", np.float64, (2, 3, 3)),  # the same for what is left of these errors, see orientation_spread
    ]
)
"""The stated motion at one end of a segment. One record, because a function takes it as one pointer."""


class Obstacle(NamedTuple):
    """The planes of one pair of shapes; scratch memory of one thread. Node k is the begin of segment k."""

    planes: Any  # (MOST_SEGMENTS, MOST_PLANES + 1, PLANE_SIZE)
    placed: Any  # (2, 3, 3): rotation of both shapes where a plane is sought
    count: Any  # (MOST_SEGMENTS,) int64: planes of each segment
    quiet: Any  # (MOST_SEGMENTS,) int8: LOUD, QUIET or APART
    node: Any  # (MOST_SEGMENTS + 1,) NODE
    middle: Any  # (MOST_SEGMENTS,) NODE: in the middle of each segment


def make_obstacle() -> Obstacle:
    """Make the scratch memory of one thread."""
    return Obstacle(
        np.zeros((MOST_SEGMENTS, MOST_PLANES + 1, PLANE_SIZE)),
        np.zeros((2, 3, 3)),
        np.zeros(MOST_SEGMENTS, np.int64),
        np.zeros(MOST_SEGMENTS, np.int8),
        np.zeros(MOST_SEGMENTS + 1, NODE),
        np.zeros(MOST_SEGMENTS, NODE),
    )


@device
def _set_turns(m: Any, t: float, off: Any, yaw_only: bool, turn: Any, left: Any) -> None:
    """Write the rotation vectors of a body with motion m at time t for unit errors; off: see `orientation_spread`."""
    set_turn(m, t, (off[0], off[1]), yaw_only, turn)
    if off[3] > 0.0:
        set_turn(m, t, (off[2], off[3]), yaw_only, left)
        return
    for r in range(3):
        for c in range(3):
            left[r, c] = 0.0


@device
def _place(table: Any, parts: Any, pair: Any, t: float, turning: Any, yaw_only: Any, scratch: Any, node: Any) -> None:
    """Set a node to time t, see `set_nodes`."""
    A, B, a, b = pair
    R_i, R_j = scratch.rotation[0], scratch.rotation[1]
    node.time = t
    rotation_at(A, t, R_i)
    rotation_at(B, t, R_j)
    p = relative_position(A, B, t)
    oa = place_shape(table, parts, a, R_i, node.rotation[0])
    ob = place_shape(table, parts, b, R_j, node.rotation[1])
    for c in range(3):
        node.position[c] = p[c]
        node.offset[0, c], node.offset[1, c] = oa[c], ob[c]
    _set_turns(A, t, turning[0], yaw_only[0], node.turn[0], node.left[0])
    _set_turns(B, t, turning[1], yaw_only[1], node.turn[1], node.left[1])


@inlined
def set_middles(
    table: Any, parts: Any, pair: Any, segments: int, turning: Any, yaw_only: Any, scratch: Any, obstacle: Obstacle
) -> None:
    """Place the shapes of the pair (ShapePair) in the middle of each segment. turning, yaw_only: see `set_nodes`."""
    for k in range(segments):
        middle = 0.5 * (obstacle.node[k].time + obstacle.node[k + 1].time)
        _place(table, parts, pair, middle, turning, yaw_only, scratch, obstacle.middle[k])


@device
def set_nodes(
    table: Any, parts: Any, pair: Any, window: Any, length: float, turning: Any, yaw_only: Any, scratch: Any,
    obstacle: Obstacle,
) -> int:  # fmt: skip
    """Divide the window into segments of this length (s) without planes; return their number, at most MOST_SEGMENTS.

    The last one is shorter, or the segments end before the window. Places the shapes of the pair (ShapePair) at their
    ends. turning: for both bodies, see `orientation_spread`.
    yaw_only: for both, whether it is about the z axis alone.
    """
    begin, end = window
    segments = 0
    for k in range(MOST_SEGMENTS + 1):
        t = min(begin + k * length, end)
        _place(table, parts, pair, t, turning, yaw_only, scratch, obstacle.node[k])
        segments = k
        if t >= end:
            break
    for k in range(segments):
        obstacle.count[k], obstacle.quiet[k] = 0, LOUD
    return segments


@device
def split_segment(
    table: Any, parts: Any, pair: Any, k: int, segments: int, turning: Any, yaw_only: Any, scratch: Any,
    obstacle: Obstacle,
) -> None:  # fmt: skip
    """Divide segment k of the obstacle, with its planes, into two halves. There is room for one more segment."""
    planes, count, node, middle = obstacle.planes, obstacle.count, obstacle.node, obstacle.middle
    for m in range(segments, k, -1):
        count[m], obstacle.quiet[m] = count[m - 1], obstacle.quiet[m - 1]
        node[m + 1], middle[m] = node[m], middle[m - 1]
        for p in range(count[m]):
            for c in range(PLANE_SIZE):
                planes[m, p, c] = planes[m - 1, p, c]
    node[k + 1] = middle[k]
    if count[k] > MOST_PLANES // 2:  # each half needs other ones
        count[k] = count[k + 1] = 0
    for m in range(k, k + 2):
        _place(table, parts, pair, 0.5 * (node[m].time + node[m + 1].time), turning, yaw_only, scratch, middle[m])


@inlined
def from_plane(plane: Any, R: Any) -> Any:
    """Normal of a plane in world axes, at a node with the rotations R (2, 3, 3) of the shapes."""
    x, y, z, mode = plane[0], plane[1], plane[2], int(plane[MODE])
    if mode == AT_REST:
        return x, y, z
    T = R[mode]
    return (
        T[0, 0] * x + T[0, 1] * y + T[0, 2] * z,
        T[1, 0] * x + T[1, 1] * y + T[1, 2] * z,
        T[2, 0] * x + T[2, 1] * y + T[2, 2] * z,
    )


@inlined
def set_plane(n: Vector, mode: int, obstacle: Obstacle, plane: Any) -> None:
    """Write the plane along n (3,), a unit vector from shape a to shape b, where obstacle.placed has the shapes."""
    x, y, z = n
    if mode != AT_REST:
        T = obstacle.placed[mode]
        x, y, z = (
            T[0, 0] * x + T[1, 0] * y + T[2, 0] * z,
            T[0, 1] * x + T[1, 1] * y + T[2, 1] * z,
            T[0, 2] * x + T[1, 2] * y + T[2, 2] * z,
        )
    plane[0], plane[1], plane[2], plane[MODE] = x, y, z, mode


@inlined
def _turn_by(R: Any, v: Any) -> None:
    """Turn the rotation R (3, 3) by the rotation vector v (3,)."""
    x, y, z = v
    angle = sqrt(x * x + y * y + z * z)
    if angle == 0.0:
        return
    half_sine, half_cosine = sin_cos(0.5 * angle)
    c = 2.0 * half_sine * half_sine
    s = 2.0 * half_sine * half_cosine
    x, y, z = x / angle, y / angle, z / angle
    for j in range(3):
        u, v, w = R[0, j], R[1, j], R[2, j]
        ax, ay, az = y * w - z * v, z * u - x * w, x * v - y * u
        R[0, j] = u + s * ax + c * (y * az - z * ay)
        R[1, j] = v + s * ay + c * (z * ax - x * az)
        R[2, j] = w + s * az + c * (x * ay - y * ax)


@device
def separation_at(
    table: Any, parts: Any, pair: Any, t: float, error: Vector, turned: Any, accuracy: Any, obstacle: Obstacle,
    scratch: Any,
) -> float:  # fmt: skip
    """Return the separation (m) of a pair of shapes at time t, with B off by `error` (3,).

    turned: rotation vectors (3,) of the errors of orientation of A and of B; accuracy: see `separation`. Writes the
    direction of the separation into scratch.out, and the rotations of the shapes into obstacle.placed.
    """
    A, B, a, b = pair
    R_i, R_j, R_a, R_b = scratch.rotation[0], scratch.rotation[1], obstacle.placed[0], obstacle.placed[1]
    rotation_at(A, t, R_i)
    rotation_at(B, t, R_j)
    _turn_by(R_i, turned[0])
    _turn_by(R_j, turned[1])
    oa = place_shape(table, parts, a, R_i, R_a)
    ob = place_shape(table, parts, b, R_j, R_b)
    x, y, z = relative_position(A, B, t)
    x, y, z = x + error[0], y + error[1], z + error[2]
    pose = PairPose(R_a, R_b, (x + ob[0] - oa[0], y + ob[1] - oa[1], z + ob[2] - oa[2]))
    return separation(table, a, b, pose, scratch.out, scratch.work, accuracy)
