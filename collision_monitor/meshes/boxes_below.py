"""The boxes of a block with numbers below a limit, as the bits of a number, so that a kernel visits only these."""

from __future__ import annotations

from typing import Any

from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.extending import intrinsic

from collision_monitor._jit import device, inlined
from collision_monitor._jit.lanes import Lanes, load_lanes
from collision_monitor.meshes.boxes import Block
from collision_monitor.meshes.layout import CHILD, WIDTH


def is_all_above_zero(numbers: Lanes) -> Any:
    """Whether all eight numbers are above 0, while a kernel is compiled."""
    builder, zero = numbers.builder, Lanes.constant(numbers.builder, 0.0)
    bits = builder.bitcast(builder.fcmp_ordered(">", numbers.value, zero.value), ir.IntType(WIDTH))
    return builder.icmp_unsigned("==", bits, ir.Constant(bits.type, -1))


@intrinsic
def _below(typing_context: Any, limit: Any, numbers: Any, at: Any, blocks: Any, block: Any) -> Any:
    signature = types.int64(types.float64, numbers, types.int64, blocks, types.int64)

    def codegen(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        limit = Lanes.constant(builder, arguments[0])
        number = load_lanes(context, builder, signature.args[1], arguments[1], arguments[2])
        child = Block(context, builder, signature.args[3], arguments[3], arguments[4]).row(CHILD)
        less = builder.fcmp_ordered("<", number.value, limit.value)
        used = builder.fcmp_unordered("!=", child.value, Lanes.constant(builder, 0.0).value)
        bits = builder.bitcast(builder.and_(less, used), ir.IntType(WIDTH))
        return builder.zext(bits, cgutils.intp_t)

    return signature, codegen


@device
def boxes_below(limit: float, numbers: Any, at: int, blocks: Any, block: int) -> int:
    """Bits of the used boxes of a block whose numbers, numbers[at: at + 8], are below a limit."""
    return _below(limit, numbers, at, blocks, block)


@intrinsic
def _first(typing_context: Any, bits: Any) -> Any:
    signature = types.int64(types.int64)

    def codegen(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        return builder.cttz(arguments[0], ir.Constant(ir.IntType(1), 1))

    return signature, codegen


@inlined
def first_of(bits: int) -> int:
    """The lowest bit of a number that is not 0."""
    return _first(bits)


@intrinsic
def _count(typing_context: Any, bits: Any) -> Any:
    signature = types.int64(types.int64)

    def codegen(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        return builder.ctpop(arguments[0])

    return signature, codegen


@inlined
def count_of(bits: int) -> int:
    """Number of bits that are 1."""
    return _count(bits)
