"""Which triangles of a leaf may cross another triangle: those that no plane of either separates, eight at once.

The first step of two triangles' test (Moeller, 1997), with the operations of `crossing_point` in their order, so that
both agree to the last bit.
"""

from __future__ import annotations

from typing import Any

from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.extending import intrinsic

from collision_monitor._jit.lanes import Lanes
from collision_monitor.meshes.boxes import Block
from collision_monitor.meshes.layout import CORNERS, RADIUS, WIDTH

_POINT = list[Lanes]


def _dot(a: _POINT, b: _POINT) -> Lanes:
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def _minus(a: _POINT, b: _POINT) -> _POINT:
    return [a[k] - b[k] for k in range(3)]


def _normal(corners: list[_POINT]) -> _POINT:
    a, b = _minus(corners[1], corners[0]), _minus(corners[2], corners[0])
    return [a[(k + 1) % 3] * b[(k + 2) % 3] - a[(k + 2) % 3] * b[(k + 1) % 3] for k in range(3)]


def _crossed(builder: Any, S: list[_POINT], T: list[_POINT], slack: Lanes | None) -> Any:
    """Lanes in which not all corners of S are on one side of T's plane, or farther from it than the slack (m)."""
    n, zero = _normal(T), Lanes.constant(builder, 0.0)
    far = zero
    if slack is not None:  # times the length of n, or a little more
        far = slack * (abs(n[0]) + abs(n[1]) + abs(n[2]))
    x, y, z = (_dot(_minus(corner, T[0]), n) for corner in S)
    above = builder.fcmp_ordered(">", x.least(y).least(z).value, far.value)
    below = builder.fcmp_ordered("<", x.largest(y).largest(z).value, (zero - far).value)
    return builder.not_(builder.or_(above, below))


def _may_meet(context: Any, builder: Any, signature: Any, arguments: Any, slack: Any) -> Any:
    """Bits of the triangles of a block; arguments: as for `may_cross`."""
    numbers = [Lanes.constant(builder, each) for each in cgutils.unpack_tuple(builder, arguments[0])]
    members = Block(context, builder, signature.args[2], arguments[2], arguments[3])
    S = [members.vector(CORNERS + 3 * i) for i in range(3)]
    T = [numbers[3 * i : 3 * i + 3] for i in range(3)]
    radii = members.row(RADIUS) + Lanes.constant(builder, arguments[1])
    found = builder.and_(_crossed(builder, S, T, slack), _crossed(builder, T, S, slack))
    found = builder.or_(found, builder.fcmp_ordered(">", radii.value, Lanes.constant(builder, 0.0).value))
    return builder.zext(builder.bitcast(found, ir.IntType(WIDTH)), ir.IntType(64))


@intrinsic
def may_cross(typing_context: Any, triangle: Any, radius: Any, blocks: Any, block: Any) -> Any:
    """Bit k for each triangle k of a block that no plane separates from a triangle, or if there is a radius.

    triangle: its nine coordinates in the frame of the block's tree (m). radius (m): by which it is enlarged.
    """
    signature = types.int64(triangle, radius, blocks, types.int64)

    def codegen(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        return _may_meet(context, builder, signature, arguments, None)

    return signature, codegen


@intrinsic
def may_touch(typing_context: Any, triangle: Any, radius: Any, blocks: Any, block: Any, slack: Any) -> Any:
    """`may_cross` for triangles that are at most the slack (m) apart."""
    signature = types.int64(triangle, radius, blocks, types.int64, types.float64)

    def codegen(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        return _may_meet(context, builder, signature, arguments, Lanes.constant(builder, arguments[4]))

    return signature, codegen
