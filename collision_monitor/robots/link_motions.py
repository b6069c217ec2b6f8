"""Forward kinematics: poses and twists of all links from the positions and velocities of the joints.

Source: Featherstone, Rigid Body Dynamics Algorithms (2008), 4.3: the velocity of a link is that of its parent plus that
of its joint. Here each twist refers to the origin of its link, along the axes of the world.
"""

from __future__ import annotations

from math import cos, sin
from typing import Any

import numpy as np
from numpy.typing import NDArray

from collision_monitor._jit import device, kernel
from collision_monitor.robots.kinematic_tree import SLIDING, TURNING, LinkTable

Floats = NDArray[np.float64]


def link_motions(table: LinkTable, joints: Floats, base: Floats) -> tuple[Floats, Floats]:
    """Return poses (n, L, 7) and twists (n, L, 6) of L links in n states of the robot, in the frame of the base's pose.

    joints (n, J, 2): positions in rad or m and velocities in rad/s or m/s, by the columns of the tree. base (n, 13):
    position, quaternion (unit), linear and angular velocity of the base link. A twist is the velocity of the origin of
    the link and its angular velocity, m/s and rad/s.
    """
    shape = len(base), len(table.parent)
    poses, twists = np.empty((*shape, 7)), np.empty((*shape, 6))
    poses[:, 0], twists[:, 0] = base[:, :7], base[:, 7:]
    _link_motions(*table, np.ascontiguousarray(joints), poses, twists)
    return poses, twists


def load_link_motions() -> None:
    """Compile the kernel, or load it from the cache, before messages arrive."""
    one = np.zeros((1, 3)), np.zeros((1, 4)), np.zeros((1, 3))
    row = np.zeros(1, np.int32)
    table = LinkTable(row, row, *one, row, np.zeros(1), np.zeros(1))
    link_motions(table, np.zeros((1, 0, 2)), np.zeros((1, 13)))


@kernel
def _link_motions(
    parent: Any, kind: Any, position: Any, quaternion: Any, axis: Any, variable: Any, multiplier: Any, offset: Any,
    joints: Any, poses: Any, twists: Any,
) -> Any:  # fmt: skip
    for n in range(len(poses)):
        for i in range(1, len(parent)):
            above, pose, twist = poses[n, parent[i]], poses[n, i], twists[n, i]
            x, y, z = position[i]
            value = speed = 0.0
            if variable[i] >= 0:
                value = multiplier[i] * joints[n, variable[i], 0] + offset[i]
                speed = multiplier[i] * joints[n, variable[i], 1]
            b, c, d, e = quaternion[i]
            _turn(above[3:], b, c, d, e, pose[3:])
            u, v, w = _rotated(pose[3:], axis[i, 0], axis[i, 1], axis[i, 2])  # the joint does not turn its own axis
            dx, dy, dz = _rotated(above[3:], x, y, z)
            if kind[i] == SLIDING:
                dx, dy, dz = dx + value * u, dy + value * v, dz + value * w
            pose[0], pose[1], pose[2] = above[0] + dx, above[1] + dy, above[2] + dz
            _carry(twists[n, parent[i]], dx, dy, dz, twist)
            if kind[i] == SLIDING:
                twist[0] += speed * u
                twist[1] += speed * v
                twist[2] += speed * w
            elif kind[i] == TURNING:
                twist[3] += speed * u
                twist[4] += speed * v
                twist[5] += speed * w
                s = sin(0.5 * value)
                _turn(pose[3:], s * axis[i, 0], s * axis[i, 1], s * axis[i, 2], cos(0.5 * value), pose[3:])


@device
def _turn(q: Any, x: Any, y: Any, z: Any, w: Any, out: Any) -> Any:
    """Hamilton product of q and (x, y, z, w): that rotation first, then q. `out` may be q."""
    a, b, c, d = q[0], q[1], q[2], q[3]
    out[0] = d * x + a * w + b * z - c * y
    out[1] = d * y - a * z + b * w + c * x
    out[2] = d * z + a * y - b * x + c * w
    out[3] = d * w - a * x - b * y - c * z


@device
def _rotated(q: Any, x: Any, y: Any, z: Any) -> Any:
    """Vector (x, y, z) turned by a unit quaternion: v + 2 w (q x v) + 2 q x (q x v)."""
    a, b, c = 2.0 * (q[1] * z - q[2] * y), 2.0 * (q[2] * x - q[0] * z), 2.0 * (q[0] * y - q[1] * x)
    return (
        x + q[3] * a + q[1] * c - q[2] * b,
        y + q[3] * b + q[2] * a - q[0] * c,
        z + q[3] * c + q[0] * b - q[1] * a,
    )


@device
def _carry(twist: Any, dx: Any, dy: Any, dz: Any, out: Any) -> Any:
    """Twist of a rigid body at the point (dx, dy, dz) from where `twist` refers to."""
    out[0] = twist[0] + twist[4] * dz - twist[5] * dy
    out[1] = twist[1] + twist[5] * dx - twist[3] * dz
    out[2] = twist[2] + twist[3] * dy - twist[4] * dx
    out[3], out[4], out[5] = twist[3], twist[4], twist[5]
