"""Lower bounds on the distances of all pairs of triangles of two leaves, along a direction between any two of them."""

from __future__ import annotations

from collections.abc import Callable
from functools import reduce
from typing import Any, Final

from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.extending import intrinsic

from collision_monitor._jit import device, inlined
from collision_monitor._jit.lanes import Lanes, load_lanes, store
from collision_monitor.geometry.vector import Vector, opposite
from collision_monitor.meshes.boxes import Block, inner
from collision_monitor.meshes.layout import CORNERS, RADIUS, WIDTH
from collision_monitor.meshes.placing import Placing, turn_back

PAIRS_OF_LEAVES: Final = WIDTH * WIDTH


def _reach(n: list[Lanes], members: Block) -> Lanes:
    """How far the triangles of a block reach along n, with their radii (m)."""
    x, y, z = (inner(n, members.vector(CORNERS + 3 * i)) for i in range(3))
    return x.largest(y).largest(z) + members.row(RADIUS)


@intrinsic
def _reach_along(typing_context: Any, n: Any, blocks: Any, block: Any, out: Any, at: Any) -> Any:
    """Write how far the triangles of a block reach along n, with their radii, to out[at: at + 8] (m)."""
    signature = types.void(n, blocks, types.int64, out, types.int64)

    def codegen(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        n = [Lanes.constant(builder, each) for each in cgutils.unpack_tuple(builder, arguments[0])]
        members = Block(context, builder, signature.args[1], arguments[1], arguments[2])
        store(context, builder, _reach(n, members), signature.args[3], arguments[3], arguments[4])
        return context.get_dummy_value()

    return signature, codegen


@intrinsic
def _raise_bounds(typing_context: Any, numbers: Any, work: Any, other: Any, known: Any, out: Any) -> Any:
    """Write max(least, known, (gap - other)^2) to work[out: out + 8], of the numbers least (m^2) and gap (m)."""
    signature = types.void(numbers, work, types.int64, types.int64, types.int64)

    def codegen(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        least, gap = (Lanes.constant(builder, each) for each in cgutils.unpack_tuple(builder, arguments[0]))
        array = signature.args[1], arguments[1]
        far, before = (load_lanes(context, builder, *array, at) for at in arguments[2:4])
        open_ = (gap - far).largest(Lanes.constant(builder, 0.0))
        store(context, builder, before.largest(least).largest(open_ * open_), *array, arguments[4])
        return context.get_dummy_value()

    return signature, codegen


@device
def raise_bounds(
    n: Vector, blocks_a: Any, leaf_a: int, blocks_b: Any, leaf_b: int, X: Placing, work: Any, at: int, near: int
) -> None:
    """Raise the bounds on the squared distances of all pairs, work[at: at + 64], to those along a unit direction n.

    near >= 0: begin with the larger of work[near + k] and work[near + 8 + m] for the triangles k of A and m of B.
    """
    far = at + PAIRS_OF_LEAVES
    gap = n[0] * X.x + n[1] * X.y + n[2] * X.z
    _reach_along(n, blocks_a, leaf_a, work, far)
    _reach_along(turn_back(X, opposite(n)), blocks_b, leaf_b, work, far + WIDTH)
    for k in range(WIDTH):
        row = at + WIDTH * k
        if near >= 0:
            _raise_bounds((work[near + k], gap - work[far + k]), work, far + WIDTH, near + WIDTH, row)
        else:
            _raise_bounds((0.0, gap - work[far + k]), work, far + WIDTH, row, row)


def _foremost(rows: list[Lanes], better: Callable[[Lanes, Lanes], Lanes]) -> Any:
    """The largest or the least of some rows of eight numbers, as a number."""
    number, best = ir.IntType(32), reduce(better, rows)
    for width in (4, 2, 1):
        order = ir.Constant(ir.VectorType(number, WIDTH), [(k + width) % WIDTH for k in range(WIDTH)])
        best = better(best, Lanes(best.builder, best.builder.shuffle_vector(best.value, best.value, order)))
    return best.builder.extract_element(best.value, number(0))


@intrinsic
def _farthest(typing_context: Any, n: Any, blocks: Any, block: Any) -> Any:
    signature = types.float64(n, blocks, types.int64)

    def codegen(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        n = [Lanes.constant(builder, each) for each in cgutils.unpack_tuple(builder, arguments[0])]
        reach = _reach(n, Block(context, builder, signature.args[1], arguments[1], arguments[2]))
        return _foremost([reach], Lanes.largest)

    return signature, codegen


@device
def farthest_along(n: Vector, blocks: Any, leaf: int) -> float:
    """How far the triangles of a leaf reach along n, with their radii (m)."""
    return _farthest(n, blocks, leaf)


@intrinsic
def _least(typing_context: Any, work: Any, at: Any) -> Any:
    signature = types.float64(work, types.int64)

    def codegen(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        rows = _rows(context, builder, signature.args[0], arguments)
        return _foremost(rows, Lanes.least)

    return signature, codegen


@intrinsic
def _first_equal(typing_context: Any, work: Any, at: Any, number: Any) -> Any:
    """The first number of all pairs that equals another one, or the last."""
    signature = types.int64(work, types.int64, types.float64)

    def codegen(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        number, bits = Lanes.constant(builder, arguments[2]), ir.Constant(ir.IntType(64), 1 << (PAIRS_OF_LEAVES - 1))
        for k, row in enumerate(_rows(context, builder, signature.args[0], arguments)):
            equal = builder.bitcast(builder.fcmp_ordered("==", row.value, number.value), ir.IntType(WIDTH))
            bits = builder.or_(bits, builder.shl(builder.zext(equal, bits.type), bits.type(WIDTH * k)))
        return builder.cttz(bits, ir.Constant(ir.IntType(1), 1))

    return signature, codegen


def _rows(context: Any, builder: Any, array_type: Any, arguments: Any) -> list[Lanes]:
    """The numbers of all pairs of triangles of two leaves, from an array (the first argument) and a place there."""
    array, at = arguments[:2]
    return [load_lanes(context, builder, array_type, array, at, row) for row in range(0, PAIRS_OF_LEAVES, WIDTH)]


@inlined
def least_of_pairs(work: Any, at: int) -> tuple[float, int]:
    """Least of the numbers of all pairs of triangles of two leaves, and the pair: 8 k + m."""
    best = _least(work, at)
    return best, _first_equal(work, at, best)
