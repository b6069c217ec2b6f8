"""Farthest vertex of a hull in a direction, computed for eight vertices at a time.

LLVM does not vectorise an arg-max without `fastmath`, so the loop is written in its vector types here. The result is
the same on every processor, because products and sums are rounded one by one, and of equal vertices the first wins.
"""

from __future__ import annotations

from typing import Any

from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.extending import intrinsic

from collision_monitor._jit.vectors import DOUBLES, LANES, spread

_LANE = ir.IntType(32)
_INDICES = ir.VectorType(ir.IntType(64), LANES)


def _vector(constants: list[int]) -> Any:
    return ir.Constant(_INDICES, constants)


def _better(builder: Any, value: Any, index: Any, other_value: Any, other_index: Any) -> Any:
    """Return the greater value with its index, lane by lane; of equal values the one with the smaller index."""
    farther = builder.fcmp_ordered(">", other_value, value)
    equal = builder.fcmp_ordered("==", other_value, value)
    take = builder.or_(farther, builder.and_(equal, builder.icmp_signed("<", other_index, index)))
    return builder.select(take, other_value, value), builder.select(take, other_index, index)


@intrinsic
def farthest_vertex(typing_context: Any, vertices: Any, start: Any, count: Any, dx: Any, dy: Any, dz: Any) -> Any:
    """Index of the first vertex with the greatest d.v among `count` columns of vertices (3, V) from `start` on.

    count is a positive multiple of LANES, to which the shape table pads it. The numbers of a row lie side by side.
    """
    signature = types.int64(vertices, types.int64, types.int64, types.float64, types.float64, types.float64)

    def codegen(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        array = context.make_array(signature.args[0])(context, builder, arguments[0])
        start, count = arguments[1], arguments[2]
        direction = [spread(builder, d) for d in arguments[3:]]
        index_type = ir.IntType(64)
        row_bytes = cgutils.unpack_tuple(builder, array.strides)[0]  # which a part of a table shares with the table
        row_length = builder.udiv(row_bytes, index_type(8))
        rows = [
            builder.gep(array.data, [builder.add(start, builder.mul(row_length, index_type(row)))]) for row in range(3)
        ]

        def dots(offset: Any) -> Any:
            total = None
            for row, d in zip(rows, direction, strict=True):
                place = builder.bitcast(builder.gep(row, [offset]), DOUBLES.as_pointer())
                product = builder.fmul(builder.load(place, align=8), d)
                total = product if total is None else builder.fadd(total, product)
            return total

        most = cgutils.alloca_once_value(builder, dots(index_type(0)))
        where = cgutils.alloca_once_value(builder, _vector(list(range(LANES))))
        with cgutils.for_range_slice(builder, index_type(LANES), count, index_type(LANES)) as (offset, _):
            here = dots(offset)
            indices = builder.add(spread(builder, offset, _INDICES), _vector(list(range(LANES))))
            farther = builder.fcmp_ordered(">", here, builder.load(most))
            builder.store(builder.select(farther, here, builder.load(most)), most)
            builder.store(builder.select(farther, indices, builder.load(where)), where)

        # halve the lanes down to two, then compare these as scalars; of equal values the smaller index wins
        values, indices = builder.load(most), builder.load(where)
        half = LANES // 2
        while half > 1:
            low = ir.Constant(ir.VectorType(_LANE, half), list(range(half)))
            high = ir.Constant(ir.VectorType(_LANE, half), list(range(half, 2 * half)))
            values, indices = _better(
                builder,
                builder.shuffle_vector(values, values, low),
                builder.shuffle_vector(indices, indices, low),
                builder.shuffle_vector(values, values, high),
                builder.shuffle_vector(indices, indices, high),
            )
            half //= 2
        first, second = _LANE(0), _LANE(1)
        _, index = _better(
            builder,
            builder.extract_element(values, first),
            builder.extract_element(indices, first),
            builder.extract_element(values, second),
            builder.extract_element(indices, second),
        )
        return builder.add(start, index)

    return signature, codegen
