"""Formulas on vectors of eight numbers: LLVM values with Python's operators, for kernels that LLVM does not vectorise.

Each lane is rounded like the scalar operation, so that the results are the same on every processor.
"""

from __future__ import annotations

from typing import Any, Self

from llvmlite import ir

from collision_monitor._jit.vectors import DOUBLES, LANES, spread

_INDEX = ir.IntType(64)


class Lanes:
    """A vector of LANES float64 while a kernel is compiled."""

    def __init__(self, builder: Any, value: Any) -> None:
        self.builder, self.value = builder, value

    @classmethod
    def constant(cls, builder: Any, number: Any) -> Self:
        """A vector with an LLVM number, or a number of Python, in every lane."""
        return cls(builder, spread(builder, number if isinstance(number, ir.Value) else ir.DoubleType()(number)))

    def __add__(self, other: Lanes) -> Lanes:
        """Sum."""
        return Lanes(self.builder, self.builder.fadd(self.value, other.value))

    def __sub__(self, other: Lanes) -> Lanes:
        """Difference."""
        return Lanes(self.builder, self.builder.fsub(self.value, other.value))

    def __mul__(self, other: Lanes) -> Lanes:
        """Product."""
        return Lanes(self.builder, self.builder.fmul(self.value, other.value))

    def __truediv__(self, other: Lanes) -> Lanes:
        """Quotient."""
        return Lanes(self.builder, self.builder.fdiv(self.value, other.value))

    def plus_product(self, a: Lanes, b: Lanes) -> Lanes:
        """The sum of this number and a product, rounded once."""
        return self._applied("fma", a, b, self)

    def __abs__(self) -> Lanes:
        """Absolute value."""
        return self._applied("fabs", self)

    def root(self) -> Lanes:
        """Square root."""
        return self._applied("sqrt", self)

    def where(self, condition: Lanes, other: Lanes) -> Lanes:
        """The number itself where the condition is above 0, else the other's."""
        yes = self.builder.fcmp_ordered(">", condition.value, ir.Constant(DOUBLES, [0.0] * LANES))
        return Lanes(self.builder, self.builder.select(yes, self.value, other.value))

    def _applied(self, function: str, *numbers: Lanes) -> Lanes:
        name = f"llvm.{function}.v{LANES}f64"
        known = self.builder.module.globals.get(name)
        types = ir.FunctionType(DOUBLES, [DOUBLES] * len(numbers))
        intrinsic = known or ir.Function(self.builder.module, types, name)
        return Lanes(self.builder, self.builder.call(intrinsic, [each.value for each in numbers]))

    def largest(self, other: Lanes) -> Lanes:
        """The larger of each two numbers."""
        more = self.builder.fcmp_ordered(">", self.value, other.value)
        return Lanes(self.builder, self.builder.select(more, self.value, other.value))

    def least(self, other: Lanes) -> Lanes:
        """The smaller of each two numbers."""
        less = self.builder.fcmp_ordered("<", self.value, other.value)
        return Lanes(self.builder, self.builder.select(less, self.value, other.value))


def load_lanes(context: Any, builder: Any, array_type: Any, array: Any, at: Any, offset: int = 0) -> Lanes:
    """LANES numbers of the data of a contiguous array of float64, from the element `at` + offset on."""
    return Lanes(builder, builder.load(_pointer(context, builder, array_type, array, at, offset), align=8))


def store(context: Any, builder: Any, lanes: Lanes, array_type: Any, array: Any, at: Any, offset: int = 0) -> None:
    """Write a vector to the data of a contiguous array of float64, from the element `at` + offset on."""
    builder.store(lanes.value, _pointer(context, builder, array_type, array, at, offset), align=8)


def _pointer(context: Any, builder: Any, array_type: Any, array: Any, at: Any, offset: int) -> Any:
    struct = context.make_array(array_type)(context, builder, array)
    place = builder.add(at, _INDEX(offset))
    return builder.bitcast(builder.gep(struct.data, [place]), DOUBLES.as_pointer())
