"""Prefetch of memory for a later iteration while the current one computes."""

from __future__ import annotations

from typing import Any, Final

from llvmlite import ir
from numba.core import types
from numba.extending import intrinsic

CACHE_LINE: Final = 64
"""Size of a cache line (bytes)."""


@intrinsic
def prefetch(context: Any, array: Any, row: Any) -> Any:
    """Prefetch array[row]; if the row is itself an array of numbers, its first 64 bytes. The result does not change.

    Kernels that visit bodies in random memory order would otherwise wait for memory longer than they compute.
    """

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        values = context.make_array(signature.args[0])(context, builder, arguments[0])
        byte, number = ir.IntType(8).as_pointer(), ir.IntType(32)
        start = builder.mul(arguments[1], builder.extract_value(values.strides, 0))
        address = builder.gep(builder.bitcast(values.data, byte), [start])
        kind = ir.FunctionType(ir.VoidType(), [byte, number, number, number])
        function = builder.module.declare_intrinsic("llvm.prefetch", [byte], kind)
        to_read, keep, data = number(0), number(3), number(1)
        for offset in range(0, context.get_abi_sizeof(context.get_data_type(array.dtype)), CACHE_LINE):
            line = builder.gep(address, [ir.IntType(64)(offset)])
            builder.call(function, [line, to_read, keep, data])
        return context.get_dummy_value()

    return types.void(array, types.intp), generate
