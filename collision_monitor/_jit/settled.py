"""Kernels that Python code calls with arguments of the same types each time, so that only the first call looks at them.

To find the compiled function, numba looks at every argument, which takes as long as a short kernel: 0.4 to 0.9 µs for
five arrays, and 6 µs for the 35 arrays of the bodies and their shapes. Later calls check only that arrays are given,
but neither their dimensions nor the kind of their numbers: the package makes all of them itself, and its tests look at
the types in every call.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cached_property
from typing import Generic, TypeVar, TypeVarTuple, cast

from collision_monitor._jit.function import Function

Given = TypeVarTuple("Given")
Result = TypeVar("Result")


class SettledFunction(Function, Generic[*Given, Result]):
    """A kernel whose compiled function is the one that the first call finds."""

    @cached_property
    def entry(self) -> Callable[..., Result]:
        """The compiled function; until the first call, numba's search for it. To read it costs less than to call."""
        return self._first

    def __call__(self, *args: *Given) -> Result:
        """Call the function."""
        return self.entry(*args)

    def _first(self, *args: *Given) -> Result:
        dispatcher = self.dispatcher
        result = dispatcher(*args)
        overloads = getattr(dispatcher, "overloads", {})  # without a compiler, the dispatcher is the plain function
        if overloads:
            types = tuple(dispatcher.typeof_pyval(each) for each in args)
            self.__dict__["entry"] = overloads[types].entry_point
        return cast(Result, result)


def settled(function: Callable[[*Given], Result]) -> SettledFunction[*Given, Result]:
    """Let Python code call a kernel, with arguments of the same types each time, without numba's look at them."""
    given = cast(Function, function)
    return SettledFunction(given.py_func, given._options, given.kind)
