"""The positions and the quaternions of homogeneous matrices."""

from __future__ import annotations

from math import inf, sqrt
from typing import Any

from collision_monitor._jit import device, kernel
from collision_monitor._jit.settled import settled
from collision_monitor.tolerances import LARGEST_INPUT, UNIT_QUATERNION


@device
def _pose_of(X: Any) -> tuple[float, Any]:
    """How far the upper left (3, 3) of a matrix is from a rotation, and x, y, z, qx, qy, qz, qw of it.

    X: (4, 4), or (3, 3) for a position of 0. The first number is the error of the products of its rows, infinite for
    a reflection, for another last row than 0 0 0 1, and for what is not finite. The largest of 4 qx^2, 4 qy^2, 4 qz^2
    and 4 qw^2 loses no digits. (Shepperd, Quaternion from rotation matrix, 1978)
    """
    a, b, c = X[0, 0], X[0, 1], X[0, 2]
    d, e, f = X[1, 0], X[1, 1], X[1, 2]
    g, h, i = X[2, 0], X[2, 1], X[2, 2]
    off = abs(a * a + b * b + c * c - 1.0) + abs(d * d + e * e + f * f - 1.0) + abs(g * g + h * h + i * i - 1.0)
    off = max(off, abs(a * d + b * e + c * f) + abs(a * g + b * h + c * i) + abs(d * g + e * h + f * i))
    if not off <= 1.0 or not a * (e * i - f * h) - b * (d * i - f * g) + c * (d * h - e * g) > 0.0:
        off = inf
    x, y, z, w = 1 + a - e - i, 1 - a + e - i, 1 - a - e + i, 1 + a + e + i
    largest = max(max(x, y), max(z, w))
    if largest == w:
        x, y, z = h - f, c - g, d - b
    elif largest == x:
        y, z, w = b + d, c + g, h - f
    elif largest == y:
        x, z, w = b + d, f + h, c - g
    else:
        x, y, w = c + g, f + h, d - b
    length = sqrt(x * x + y * y + z * z + w * w)
    if not length > 0.0:
        off = inf
        length = 1.0
    px = py = pz = 0.0
    if len(X) == 4:
        px, py, pz = X[0, 3], X[1, 3], X[2, 3]
        is_finite = abs(px) <= LARGEST_INPUT and abs(py) <= LARGEST_INPUT and abs(pz) <= LARGEST_INPUT
        if not (is_finite and X[3, 0] == 0.0 and X[3, 1] == 0.0 and X[3, 2] == 0.0 and X[3, 3] == 1.0):
            off = inf
    return off, (px, py, pz, x / length, y / length, z / length, w / length)


@settled
@kernel
def matrix_to_pose(X: Any) -> tuple[float, Any]:
    """As `_pose_of`, of one matrix."""
    return _pose_of(X)


@kernel
def matrices_to_poses(X: Any, rows: Any) -> int:
    """Write x, y, z, qx, qy, qz, qw of matrices (N, 4, 4) to rows (N, 7). Return the first that is no pose, or -1."""
    for k in range(len(X)):
        off, numbers = _pose_of(X[k])
        if not off <= UNIT_QUATERNION:
            return k
        for c in range(7):
            rows[k, c] = numbers[c]
    return -1
