"""Vectors of eight numbers in LLVM's types, for the loops that LLVM does not vectorise by itself.

LLVM cuts them to the width that the processor has. Each lane is rounded as the scalar operation is, so that the answers
are the same on every processor.
"""

from __future__ import annotations

from typing import Any, Final

from llvmlite import ir

LANES: Final = 8
"""Numbers in a vector."""

DOUBLES: Final = ir.VectorType(ir.DoubleType(), LANES)
"""The type of LANES float64."""


def spread(builder: Any, value: Any, vector: Any = DOUBLES) -> Any:
    """A vector of this type with the value in every lane."""
    number = ir.IntType(32)
    one = builder.insert_element(ir.Constant(vector, ir.Undefined), value, number(0))
    return builder.shuffle_vector(one, one, ir.Constant(ir.VectorType(number, LANES), [0] * LANES))
