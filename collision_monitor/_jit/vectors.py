"""Vectors of eight numbers in LLVM's types, for the loops that LLVM does not vectorise by itself.

LLVM splits them to the vector width of the processor. Each lane is rounded like the scalar operation, so that the
results are the same on every processor.
"""

from __future__ import annotations

from typing import Any, Final

from llvmlite import ir

LANES: Final = 8
"""Number of elements of a vector."""

DOUBLES: Final = ir.VectorType(ir.DoubleType(), LANES)
"""LLVM type of a vector of LANES float64."""


def spread(builder: Any, value: Any, vector: Any = DOUBLES) -> Any:
    """Return a vector of this type with the value in every lane."""
    number = ir.IntType(32)
    one = builder.insert_element(ir.Constant(vector, ir.Undefined), value, number(0))
    return builder.shuffle_vector(one, one, ir.Constant(ir.VectorType(number, LANES), [0] * LANES))
