"""Arithmetic of kernels for vectors of three numbers, which are tuples."""

from __future__ import annotations

from math import copysign, sqrt
from typing import Any

from collision_monitor._jit import inlined

Vector = tuple[float, float, float]


@inlined
def dot(a: Vector, b: Vector) -> float:
    """a . b"""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@inlined
def cross(a: Vector, b: Vector) -> Vector:
    """a x b"""
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


@inlined
def plus(a: Vector, b: Vector) -> Vector:
    """a + b"""
    return a[0] + b[0], a[1] + b[1], a[2] + b[2]


@inlined
def minus(a: Vector, b: Vector) -> Vector:
    """a - b"""
    return a[0] - b[0], a[1] - b[1], a[2] - b[2]


@inlined
def opposite(a: Vector) -> Vector:
    """-a"""
    return -a[0], -a[1], -a[2]


@inlined
def scaled(a: Vector, factor: float) -> Vector:
    """factor a"""
    return factor * a[0], factor * a[1], factor * a[2]


@inlined
def along(a: Vector, t: float, d: Vector) -> Vector:
    """a + t d"""
    return a[0] + t * d[0], a[1] + t * d[1], a[2] + t * d[2]


@inlined
def rotate(R: Any, v: Vector) -> Vector:
    """R v"""
    return (
        R[0, 0] * v[0] + R[0, 1] * v[1] + R[0, 2] * v[2],
        R[1, 0] * v[0] + R[1, 1] * v[1] + R[1, 2] * v[2],
        R[2, 0] * v[0] + R[2, 1] * v[1] + R[2, 2] * v[2],
    )


@inlined
def rotate_back(R: Any, v: Vector) -> Vector:
    """The transpose of R times v."""
    return (
        R[0, 0] * v[0] + R[1, 0] * v[1] + R[2, 0] * v[2],
        R[0, 1] * v[0] + R[1, 1] * v[1] + R[2, 1] * v[2],
        R[0, 2] * v[0] + R[1, 2] * v[1] + R[2, 2] * v[2],
    )


@inlined
def column(R: Any, k: int) -> Vector:
    """Column k of R."""
    return R[0, k], R[1, k], R[2, k]


@inlined
def sum_of_sizes(v: Vector) -> float:
    """|x| + |y| + |z|, the scale of round-off."""
    return abs(v[0]) + abs(v[1]) + abs(v[2])


@inlined
def magnitude(v: Vector) -> float:
    """Length of v."""
    return sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2])


@inlined
def direction(v: Vector) -> tuple[float, Vector]:
    """Length and unit vector of v; 0 and +z for a zero vector. Safe from overflow and underflow."""
    x, y, z = v
    scale = max(abs(x), abs(y), abs(z))
    if not scale > 0.0:
        return 0.0, (0.0, 0.0, 1.0)
    x /= scale
    y /= scale
    z /= scale
    length = sqrt(x * x + y * y + z * z)
    return length * scale, (x / length, y / length, z / length)


@inlined
def across(v: Vector, side: Vector) -> Vector:
    """A unit vector at a right angle to the unit vector v, on the side of `side`."""
    x, y, z = v
    if abs(x) <= abs(y) and abs(x) <= abs(z):
        nx, ny, nz = 0.0, z, -y
    elif abs(y) <= abs(z):
        nx, ny, nz = -z, 0.0, x
    else:
        nx, ny, nz = y, -x, 0.0
    length = copysign(sqrt(nx * nx + ny * ny + nz * nz), nx * side[0] + ny * side[1] + nz * side[2])
    return nx / length, ny / length, nz / length
