"""Eight bodies at a time against one: which bounds overlap, as the bits of a number.

LLVM does not vectorise a loop whose results go to places that depend on earlier results, so vectors are written out
here; it cuts them to what the processor has. The comparisons are those of the scalar formulas in the docstrings.
"""

from __future__ import annotations

from typing import Any, Final

from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.extending import intrinsic

LANES: Final = 8

_LANE = ir.IntType(64)
_DOUBLES = ir.VectorType(ir.DoubleType(), LANES)


def _spread(builder: Any, value: Any) -> Any:
    """A vector with the value in every lane."""
    one = builder.insert_element(ir.Constant(_DOUBLES, ir.Undefined), value, ir.IntType(32)(0))
    return builder.shuffle_vector(one, one, ir.Constant(ir.VectorType(ir.IntType(32), LANES), [0] * LANES))


def _rows(context: Any, builder: Any, array_type: Any, array: Any, place: Any) -> list[Any]:
    """Lanes from `place` on of the three rows of a C-contiguous (3, N) array, loaded when called."""
    struct = context.make_array(array_type)(context, builder, array)
    length = cgutils.unpack_tuple(builder, struct.shape)[1]

    def load(row: int) -> Any:
        offset = builder.add(place, builder.mul(length, _LANE(row)))
        pointer = builder.bitcast(builder.gep(struct.data, [offset]), _DOUBLES.as_pointer())
        return builder.load(pointer, align=8)

    return [lambda row=row: load(row) for row in range(3)]


def _bits(builder: Any, yes: Any) -> Any:
    return builder.zext(builder.bitcast(yes, ir.IntType(LANES)), _LANE)


def _axis(builder: Any, rows: list[Any], row: int, value: Any) -> Any:
    return builder.fsub(rows[row](), _spread(builder, value))


@intrinsic
def spheres_overlap(typing_context, centre, extent, q, x, y, z, r):
    """Bit k: |centre[:, q + k] - (x, y, z)|^2 <= (r + extent[0, q + k])^2. Reads LANES places from q on."""
    signature = types.int64(centre, extent, types.int64, *[types.float64] * 4)

    def codegen(context, builder, signature, arguments):
        centres = _rows(context, builder, signature.args[0], arguments[0], arguments[2])
        radii = _rows(context, builder, signature.args[1], arguments[1], arguments[2])
        total = None
        for row in range(3):
            d = _axis(builder, centres, row, arguments[3 + row])
            square = builder.fmul(d, d)
            total = square if total is None else builder.fadd(total, square)
        reach = builder.fadd(radii[0](), _spread(builder, arguments[6]))
        return _bits(builder, builder.fcmp_ordered("<=", total, builder.fmul(reach, reach)))

    return signature, codegen


@intrinsic
def boxes_overlap(typing_context, centre, extent, q, x, y, z, hx, hy, hz):
    """Bit k: |centre[i, q + k] - (x, y, z)[i]| <= (hx, hy, hz)[i] + extent[i, q + k] on all axes i."""
    signature = types.int64(centre, extent, types.int64, *[types.float64] * 6)

    def codegen(context, builder, signature, arguments):
        centres = _rows(context, builder, signature.args[0], arguments[0], arguments[2])
        halves = _rows(context, builder, signature.args[1], arguments[1], arguments[2])
        absolute = cgutils.get_or_insert_function(
            builder.module, ir.FunctionType(_DOUBLES, [_DOUBLES]), f"llvm.fabs.v{LANES}f64"
        )
        yes = None
        for row in range(3):
            d = builder.call(absolute, [_axis(builder, centres, row, arguments[3 + row])])
            reach = builder.fadd(_spread(builder, arguments[6 + row]), halves[row]())
            within = builder.fcmp_ordered("<=", d, reach)
            yes = within if yes is None else builder.and_(yes, within)
        return _bits(builder, yes)

    return signature, codegen


@intrinsic
def lowest_bit(typing_context, bits):
    """Number of the lowest bit that is set; bits must not be 0."""
    signature = types.int64(types.int64)

    def codegen(context, builder, signature, arguments):
        return builder.cttz(arguments[0], ir.IntType(1)(1))

    return signature, codegen
