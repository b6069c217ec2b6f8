"""Pose of one tree in the frame of another, as numbers that stay in registers."""

from __future__ import annotations

from typing import Any, NamedTuple

from collision_monitor._jit import inlined
from collision_monitor.geometry.vector import Vector
from collision_monitor.meshes.distance.triangle_pair import Corners
from collision_monitor.meshes.layout import AXES


class Placing(NamedTuple):
    """Pose of a tree in another tree's frame: rotation, row by row, and position (m)."""

    r00: Any
    r01: Any
    r02: Any
    r10: Any
    r11: Any
    r12: Any
    r20: Any
    r21: Any
    r22: Any
    x: Any
    y: Any
    z: Any


@inlined
def relative(R_a: Any, R_b: Any, p: Vector) -> Placing:
    """Pose of B in A's frame from rotations (3, 3) to world axes and B's origin relative to A's (m)."""
    return Placing(
        R_a[0, 0] * R_b[0, 0] + R_a[1, 0] * R_b[1, 0] + R_a[2, 0] * R_b[2, 0],
        R_a[0, 0] * R_b[0, 1] + R_a[1, 0] * R_b[1, 1] + R_a[2, 0] * R_b[2, 1],
        R_a[0, 0] * R_b[0, 2] + R_a[1, 0] * R_b[1, 2] + R_a[2, 0] * R_b[2, 2],
        R_a[0, 1] * R_b[0, 0] + R_a[1, 1] * R_b[1, 0] + R_a[2, 1] * R_b[2, 0],
        R_a[0, 1] * R_b[0, 1] + R_a[1, 1] * R_b[1, 1] + R_a[2, 1] * R_b[2, 1],
        R_a[0, 1] * R_b[0, 2] + R_a[1, 1] * R_b[1, 2] + R_a[2, 1] * R_b[2, 2],
        R_a[0, 2] * R_b[0, 0] + R_a[1, 2] * R_b[1, 0] + R_a[2, 2] * R_b[2, 0],
        R_a[0, 2] * R_b[0, 1] + R_a[1, 2] * R_b[1, 1] + R_a[2, 2] * R_b[2, 1],
        R_a[0, 2] * R_b[0, 2] + R_a[1, 2] * R_b[1, 2] + R_a[2, 2] * R_b[2, 2],
        R_a[0, 0] * p[0] + R_a[1, 0] * p[1] + R_a[2, 0] * p[2],
        R_a[0, 1] * p[0] + R_a[1, 1] * p[1] + R_a[2, 1] * p[2],
        R_a[0, 2] * p[0] + R_a[1, 2] * p[1] + R_a[2, 2] * p[2],
    )


@inlined
def inverse(X: Placing) -> Placing:
    """The inverse of a pose."""
    return Placing(
        X.r00, X.r10, X.r20, X.r01, X.r11, X.r21, X.r02, X.r12, X.r22,
        -(X.r00 * X.x + X.r10 * X.y + X.r20 * X.z),
        -(X.r01 * X.x + X.r11 * X.y + X.r21 * X.z),
        -(X.r02 * X.x + X.r12 * X.y + X.r22 * X.z),
    )  # fmt: skip


@inlined
def place_point(X: Placing, p: Vector) -> Vector:
    """A point of the other tree in this tree's frame."""
    return (
        X.r00 * p[0] + X.r01 * p[1] + X.r02 * p[2] + X.x,
        X.r10 * p[0] + X.r11 * p[1] + X.r12 * p[2] + X.y,
        X.r20 * p[0] + X.r21 * p[1] + X.r22 * p[2] + X.z,
    )


@inlined
def turn_back(X: Placing, v: Vector) -> Vector:
    """A vector of this tree's frame in the other tree's frame."""
    return (
        X.r00 * v[0] + X.r10 * v[1] + X.r20 * v[2],
        X.r01 * v[0] + X.r11 * v[1] + X.r21 * v[2],
        X.r02 * v[0] + X.r12 * v[1] + X.r22 * v[2],
    )


@inlined
def place_triangle(X: Placing, T: Corners) -> Corners:
    """A triangle of the other tree in this tree's frame."""
    return Corners(place_point(X, T.a), place_point(X, T.b), place_point(X, T.c))


@inlined
def turned_back(blocks: Any, block: int, member: int, v: Vector) -> Vector:
    """A vector of a tree's frame in the frame of one of its boxes."""
    x, y, z = v
    return (
        blocks[block, AXES, member] * x + blocks[block, AXES + 3, member] * y + blocks[block, AXES + 6, member] * z,
        blocks[block, AXES + 1, member] * x + blocks[block, AXES + 4, member] * y + blocks[block, AXES + 7, member] * z,
        blocks[block, AXES + 2, member] * x + blocks[block, AXES + 5, member] * y + blocks[block, AXES + 8, member] * z,
    )
