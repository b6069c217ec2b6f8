"""Overlap tests of one body against eight others at a time; the results are the bits of a number.

LLVM does not vectorise a loop with output positions that depend on earlier results, so the vectors are written out
here. The docstrings give the equivalent scalar formulas.
"""

from __future__ import annotations

from typing import Any

from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.extending import intrinsic

from collision_monitor._jit.vectors import DOUBLES, LANES, spread

_PLACE = ir.IntType(64)


def _rows(context: Any, builder: Any, array_type: Any, array: Any, place: Any) -> list[Any]:
    """Loaders of the lanes from `place` on, for the three rows of a C-contiguous (3, N) array."""
    struct = context.make_array(array_type)(context, builder, array)
    length = cgutils.unpack_tuple(builder, struct.shape)[1]

    def load(row: int) -> Any:
        offset = builder.add(place, builder.mul(length, _PLACE(row)))
        pointer = builder.bitcast(builder.gep(struct.data, [offset]), DOUBLES.as_pointer())
        return builder.load(pointer, align=8)

    return [lambda row=row: load(row) for row in range(3)]


def _bits(builder: Any, yes: Any) -> Any:
    return builder.zext(builder.bitcast(yes, ir.IntType(LANES)), _PLACE)


def _axis(builder: Any, rows: list[Any], row: int, value: Any) -> Any:
    return builder.fsub(rows[row](), spread(builder, value))


@intrinsic
def spheres_overlap_lanes(typing_context: Any, centre: Any, extent: Any, q: Any, ball: Any) -> Any:
    """Bit k: |centre[:, q + k] - (x, y, z)|^2 <= (hx + extent[0, q + k])^2, with hx the radius of the Region `ball`.

    Reads LANES elements from q on.
    """
    signature = types.int64(centre, extent, types.int64, ball)

    def codegen(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        centres = _rows(context, builder, signature.args[0], arguments[0], arguments[2])
        radii = _rows(context, builder, signature.args[1], arguments[1], arguments[2])
        x, y, z, radius, _, _ = cgutils.unpack_tuple(builder, arguments[3])
        total = None
        for row, middle in enumerate((x, y, z)):
            d = _axis(builder, centres, row, middle)
            square = builder.fmul(d, d)
            total = square if total is None else builder.fadd(total, square)
        reach = builder.fadd(radii[0](), spread(builder, radius))
        return _bits(builder, builder.fcmp_ordered("<=", total, builder.fmul(reach, reach)))

    return signature, codegen


@intrinsic
def boxes_overlap(typing_context: Any, centre: Any, extent: Any, q: Any, box: Any) -> Any:
    """Bit k: |centre[i, q + k] - (x, y, z)[i]| <= (hx, hy, hz)[i] + extent[i, q + k] on all axes i of the Region `box`.

    Reads LANES elements from q on.
    """
    signature = types.int64(centre, extent, types.int64, box)

    def codegen(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        centres = _rows(context, builder, signature.args[0], arguments[0], arguments[2])
        halves = _rows(context, builder, signature.args[1], arguments[1], arguments[2])
        x, y, z, *half = cgutils.unpack_tuple(builder, arguments[3])
        absolute = cgutils.get_or_insert_function(
            builder.module, ir.FunctionType(DOUBLES, [DOUBLES]), f"llvm.fabs.v{LANES}f64"
        )
        yes = None
        for row, middle in enumerate((x, y, z)):
            d = builder.call(absolute, [_axis(builder, centres, row, middle)])
            reach = builder.fadd(spread(builder, half[row]), halves[row]())
            within = builder.fcmp_ordered("<=", d, reach)
            yes = within if yes is None else builder.and_(yes, within)
        return _bits(builder, yes)

    return signature, codegen


@intrinsic
def lowest_bit(typing_context: Any, bits: Any) -> Any:
    """Index of the lowest bit that is set; bits must not be 0."""
    signature = types.int64(types.int64)

    def codegen(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        return builder.cttz(arguments[0], ir.IntType(1)(1))

    return signature, codegen
