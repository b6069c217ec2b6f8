"""Decorators that compile the kernels, with the compiler options of the whole package.

`fastmath` is off everywhere, because results must be identical to the bit with one thread and with two, live and in
replay. Compiled kernels are cached (`cache.py`), so that a second start compiles nothing.
"""

from __future__ import annotations

import os
from collections.abc import Callable
from typing import Any, TypeVar, cast

from collision_monitor._jit.function import Function

F = TypeVar("F", bound=Callable[..., Any])

# Waiting threads of GNU OpenMP go to sleep early. If other programs need the cores too, a waiting thread that spins
# occupies the core of the thread it waits for (40 ms instead of 0.1 ms). OpenMP reads this when its first loop starts.
os.environ.setdefault("GOMP_SPINCOUNT", "1000")

_OPTIONS: dict[str, Any] = {
    "fastmath": False,
    "error_model": "numpy",
    "nogil": True,
    "boundscheck": False,
    "forceinline": False,  # a callee that does not say it inherits it from the caller that is compiled first
}


def _compile(function: F, options: dict[str, Any], kind: str = "kernel") -> F:
    return cast(F, Function(function, options, kind))


# Reference counts of array arguments are atomic memory traffic: one pair of spheres costs 300 ns with them and 18 ns
# without; the bound of a pair in a loop over many costs 86 ns with them and 34 ns without. Functions compiled with
# these options therefore only borrow their arrays: they must not allocate, and must return numbers, never an array.
_BORROWING: dict[str, Any] = {**_OPTIONS, "_nrt": False}


def kernel(function: F) -> F:
    """Compile a kernel that Python code calls with arrays; it borrows them and returns numbers."""
    return _compile(function, _BORROWING)


def allocating_kernel(function: F) -> F:
    """Compile a kernel that creates arrays. Its inner loops should be device functions, which are faster."""
    return _compile(function, _OPTIONS)


def device(function: F) -> F:
    """Compile a function that only kernels call; it borrows its arrays and returns numbers."""
    return _compile(function, _BORROWING, "device")


def inlined(function: F) -> F:
    """Compile a device function that LLVM inlines into its callers, for functions that cost less than their call.

    numba compiles it once. numba's own `inline="always"` repeats the compilation, before LLVM's, at each call: it took
    two thirds of all compile time.
    """
    return _compile(function, {**_BORROWING, "forceinline": True}, "device")


def outlined(function: F) -> F:
    """Compile a device function to machine code of its own, once, which all kernels call.

    For large functions of several kernels that LLVM does not inline anyway: they took three quarters of the time in
    which LLVM optimised the kernels. They call each other, and must not be recursive.
    """
    return _compile(function, _BORROWING, "outlined")


def parallel_kernel(function: F) -> F:
    """Compile a kernel that runs its `prange` loops on all threads; each iteration must write to its own elements."""
    # only explicit loops: numba would also move and merge loops across calls with side effects that it does not see
    others = ("comprehension", "reduction", "inplace_binop", "setitem", "numpy", "stencil", "fusion")
    return _compile(function, {**_OPTIONS, "parallel": dict.fromkeys(others, False)})
