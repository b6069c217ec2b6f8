"""The one place that decides how kernels are compiled.

`fastmath` is off everywhere: results must be the same bits with one thread and with two, live and in replay.
Compiled kernels are cached (`cache.py`), so that a second start compiles nothing.
"""

from __future__ import annotations

import os
from collections.abc import Callable
from typing import Any, TypeVar

import numba

from collision_monitor._jit import cache

F = TypeVar("F", bound=Callable[..., Any])

_CACHE_IS_CHOSEN = bool(os.environ.get("NUMBA_CACHE_DIR"))

# Threads that wait for each other soon sleep: where something else needs the cores too, a waiting thread that keeps one
# holds up the very thread it waits for (40 ms in place of 0.1 ms). Read by GNU OpenMP when its first loop starts.
os.environ.setdefault("GOMP_SPINCOUNT", "1000")

_OPTIONS: dict[str, Any] = {
    "cache": True,
    "fastmath": False,
    "error_model": "numpy",
    "nogil": True,
    "boundscheck": False,
}


def _compile(function: F, options: dict[str, Any]) -> F:
    if not _CACHE_IS_CHOSEN:
        numba.config.CACHE_DIR = cache.folder(function.__module__)
    compiled: F = numba.njit(**options)(function)
    return compiled


# Counting references to array arguments is atomic memory traffic: 300 ns for one pair of spheres, 18 ns without; and
# 86 ns for the bound of a pair in a loop over many, 34 ns without. So what is compiled here only borrows its arrays: it
# must not allocate, and must return numbers, never an array.
_BORROWING: dict[str, Any] = {**_OPTIONS, "_nrt": False}


def kernel(function: F) -> F:
    """Compile a kernel that Python code calls with arrays; it borrows them and returns numbers."""
    return _compile(function, _BORROWING)


def allocating_kernel(function: F) -> F:
    """Compile a kernel that makes arrays of its own: what loops over many of anything should be a device function."""
    return _compile(function, _OPTIONS)


def device(function: F) -> F:
    """Compile a function that only kernels call; it borrows its arrays and returns numbers."""
    return _compile(function, _BORROWING)


def inlined(function: F) -> F:
    """A device function that numba inlines into its callers: where arguments cost more to pass than to use."""
    return _compile(function, {**_BORROWING, "inline": "always"})


def parallel_kernel(function: F) -> F:
    """Compile a kernel whose `prange` loops run on all threads; each iteration must write places of its own."""
    # only what is written as a loop: numba would also move and merge loops across calls whose side effects it misses
    others = ("comprehension", "reduction", "inplace_binop", "setitem", "numpy", "stencil", "fusion")
    return _compile(function, {**_OPTIONS, "parallel": dict.fromkeys(others, False)})
