"""The gaps between a box and the eight boxes of a block, and lower bounds on its distances from eight triangles.

LLVM does not vectorise these loops, so the formulas are written in vectors (`_jit.lanes`).
"""

from __future__ import annotations

from typing import Any

from numba import types
from numba.core import cgutils
from numba.extending import intrinsic

from collision_monitor._jit import device, inlined
from collision_monitor._jit.lanes import Lanes, load_lanes, store
from collision_monitor.geometry.vector import Vector
from collision_monitor.meshes.layout import AXES, CENTER, CORNERS, HALF, RADIUS, ROWS, WIDTH
from collision_monitor.meshes.placing import Placing
from collision_monitor.tolerances import SAT_ROUND_OFF


@inlined
def seen_from(blocks: Any, block: int, member: int, X: Placing) -> Placing:
    """Pose of another tree in the frame of a box; X: that pose in the frame of the box's own tree."""
    a00, a01, a02 = blocks[block, AXES, member], blocks[block, AXES + 1, member], blocks[block, AXES + 2, member]
    a10, a11, a12 = blocks[block, AXES + 3, member], blocks[block, AXES + 4, member], blocks[block, AXES + 5, member]
    a20, a21, a22 = blocks[block, AXES + 6, member], blocks[block, AXES + 7, member], blocks[block, AXES + 8, member]
    x = X.x - blocks[block, CENTER, member]
    y = X.y - blocks[block, CENTER + 1, member]
    z = X.z - blocks[block, CENTER + 2, member]
    return Placing(
        a00 * X.r00 + a10 * X.r10 + a20 * X.r20, a00 * X.r01 + a10 * X.r11 + a20 * X.r21,
        a00 * X.r02 + a10 * X.r12 + a20 * X.r22, a01 * X.r00 + a11 * X.r10 + a21 * X.r20,
        a01 * X.r01 + a11 * X.r11 + a21 * X.r21, a01 * X.r02 + a11 * X.r12 + a21 * X.r22,
        a02 * X.r00 + a12 * X.r10 + a22 * X.r20, a02 * X.r01 + a12 * X.r11 + a22 * X.r21,
        a02 * X.r02 + a12 * X.r12 + a22 * X.r22,
        a00 * x + a10 * y + a20 * z, a01 * x + a11 * y + a21 * z, a02 * x + a12 * y + a22 * z,
    )  # fmt: skip


@inlined
def half_of(blocks: Any, block: int, member: int) -> Vector:
    """Half extents of a box (m)."""
    return blocks[block, HALF, member], blocks[block, HALF + 1, member], blocks[block, HALF + 2, member]


class Block:
    """The vectors of a block while a kernel is compiled."""

    def __init__(self, context: Any, builder: Any, array_type: Any, array: Any, block: Any) -> None:
        self._load = lambda row: load_lanes(
            context, builder, array_type, array, builder.mul(block, block.type(ROWS * WIDTH)), WIDTH * row
        )

    def vector(self, row: int) -> list[Lanes]:
        """Three rows: x, y and z of eight vectors."""
        return [self._load(row + k) for k in range(3)]

    def matrix(self, row: int) -> list[list[Lanes]]:
        """Nine rows: eight matrices."""
        return [self.vector(row + 3 * k) for k in range(3)]

    def row(self, row: int) -> Lanes:
        """One row."""
        return self._load(row)


def inner(a: list[Lanes], b: list[Lanes]) -> Lanes:
    """Dot products of eight pairs of vectors, with one rounding for each term."""
    return (a[0] * b[0]).plus_product(a[1], b[1]).plus_product(a[2], b[2])


def _column(m: list[list[Lanes]], k: int) -> list[Lanes]:
    return [m[0][k], m[1][k], m[2][k]]


def _gaps(x: list[Lanes], own: list[Lanes], shadow: list[Lanes], zero: Lanes) -> Lanes:
    """Squared distance of two axis-aligned boxes, x apart, with these half extents."""
    gap = [(abs(x[k]) - own[k] - shadow[k]).largest(zero) for k in range(3)]
    return inner(gap, gap)


@intrinsic
def _gap_bounds(typing_context: Any, half: Any, M: Any, blocks: Any, block: Any, out: Any, at: Any) -> Any:
    signature = types.void(half, M, blocks, types.int64, out, types.int64)

    def codegen(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        zero = Lanes.constant(builder, 0.0)
        e = [Lanes.constant(builder, number) for number in cgutils.unpack_tuple(builder, arguments[0])]
        placing = [Lanes.constant(builder, number) for number in cgutils.unpack_tuple(builder, arguments[1])]
        members = Block(context, builder, signature.args[2], arguments[2], arguments[3])
        axes, center, f = members.matrix(AXES), members.vector(CENTER), members.vector(HALF)
        R = [[inner(placing[3 * r : 3 * r + 3], _column(axes, c)) for c in range(3)] for r in range(3)]
        x = [inner(placing[3 * r : 3 * r + 3], center) + placing[9 + r] for r in range(3)]
        size = [[abs(R[r][c]) for c in range(3)] for r in range(3)]
        bound = _gaps(x, e, [inner(size[r], f) for r in range(3)], zero)
        y = [inner(_column(R, c), x) for c in range(3)]
        bound = bound.largest(_gaps(y, f, [inner(_column(size, c), e) for c in range(3)], zero))
        known = load_lanes(context, builder, signature.args[4], arguments[4], arguments[5])
        store(context, builder, known.largest(bound), signature.args[4], arguments[4], arguments[5])
        return context.get_dummy_value()

    return signature, codegen


@intrinsic
def _separations(typing_context: Any, half: Any, M: Any, blocks: Any, block: Any, out: Any, at: Any) -> Any:
    signature = types.void(half, M, blocks, types.int64, out, types.int64)

    def codegen(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        def vectors(k: int) -> list[Lanes]:
            return [Lanes.constant(builder, number) for number in cgutils.unpack_tuple(builder, arguments[k])]

        e, placing, one = vectors(0), vectors(1), Lanes.constant(builder, 1.0)
        members = Block(context, builder, signature.args[2], arguments[2], arguments[3])
        axes, center, f = members.matrix(AXES), members.vector(CENTER), members.vector(HALF)
        R = [[inner(placing[3 * r : 3 * r + 3], _column(axes, c)) for c in range(3)] for r in range(3)]
        x = [inner(placing[3 * r : 3 * r + 3], center) + placing[9 + r] for r in range(3)]
        size = [[abs(R[r][c]) for c in range(3)] for r in range(3)]
        gaps = [abs(x[r]) - e[r] - inner(size[r], f) for r in range(3)]
        gaps += [abs(inner(_column(R, c), x)) - f[c] - inner(_column(size, c), e) for c in range(3)]
        sizes = inner([abs(each) for each in x], [one] * 3) + inner(e, [one] * 3)
        slack = Lanes.constant(builder, SAT_ROUND_OFF) * (sizes + inner(f, [one] * 3))
        widest = gaps[0]
        for gap in gaps[1:]:
            widest = widest.largest(gap)
        crossed = gaps[0]
        for k in range(3):  # the cross product of axis k of the box and axis c of another
            i, j = (k + 1) % 3, (k + 2) % 3
            for c in range(3):
                a, b = (c + 1) % 3, (c + 2) % 3
                gap = abs(x[j] * R[i][c] - x[i] * R[j][c]) - e[i] * size[j][c] - e[j] * size[i][c]
                gap = gap - f[a] * size[k][b] - f[b] * size[k][a]
                crossed = crossed.largest(gap - slack)
        store(context, builder, crossed.where(crossed, widest), signature.args[4], arguments[4], arguments[5])
        return context.get_dummy_value()

    return signature, codegen


@intrinsic
def _triangle_bounds(typing_context: Any, half: Any, M: Any, blocks: Any, block: Any, out: Any, at: Any) -> Any:
    signature = types.void(half, M, blocks, types.int64, out, types.int64)

    def codegen(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        zero = Lanes.constant(builder, 0.0)
        e = [Lanes.constant(builder, number) for number in cgutils.unpack_tuple(builder, arguments[0])]
        placing = [Lanes.constant(builder, number) for number in cgutils.unpack_tuple(builder, arguments[1])]
        members = Block(context, builder, signature.args[2], arguments[2], arguments[3])
        corners, radius = [members.vector(CORNERS + 3 * i) for i in range(3)], members.row(RADIUS)
        bound = zero
        for r in range(3):
            a, b, c = [inner(placing[3 * r : 3 * r + 3], corner) + placing[9 + r] for corner in corners]
            low, high = a.least(b).least(c) - radius, a.largest(b).largest(c) + radius
            gap = (low - e[r]).largest(zero - e[r] - high).largest(zero)
            bound = bound + gap * gap
        store(context, builder, bound, signature.args[4], arguments[4], arguments[5])
        return context.get_dummy_value()

    return signature, codegen


@device
def raise_by_gaps(blocks_a: Any, a: int, member: int, blocks_b: Any, b: int, X: Placing, out: Any, at: int) -> None:
    """Raise bounds on the squared distances of a box from the eight boxes of block b, out[at: at + 8], to those along
    the axes of either (m^2). Arguments as for `box_separations`.
    """
    _gap_bounds(half_of(blocks_a, a, member), seen_from(blocks_a, a, member, X), blocks_b, b, out, at)


@device
def box_separations(blocks_a: Any, a: int, member: int, blocks_b: Any, b: int, X: Placing, out: Any, at: int) -> None:
    """Write the largest gaps of a box and the eight boxes of block b along an axis of either to out[at: at + 8] (m).

    blocks_a, a, member: the box. X: pose of the tree of b in the frame of the box's tree. A gap above 0 separates them;
    the more it is below 0, the deeper they overlap.
    """
    _separations(half_of(blocks_a, a, member), seen_from(blocks_a, a, member, X), blocks_b, b, out, at)


@device
def triangle_bounds(blocks_a: Any, a: int, member: int, blocks_b: Any, b: int, X: Placing, out: Any, at: int) -> None:
    """Write lower bounds on the squared distances of a box from the triangles of block b to out[at: at + 8] (m^2)."""
    _triangle_bounds(half_of(blocks_a, a, member), seen_from(blocks_a, a, member, X), blocks_b, b, out, at)
