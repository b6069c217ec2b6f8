"""The one place that decides how kernels are compiled.

`fastmath` is off everywhere: results must be the same bits with one thread and with two, live and in replay.
Compiled kernels are cached in a folder named by the content of the sources, so that a changed kernel
can never be answered by an old one that was inlined into its caller.
"""

from __future__ import annotations

import hashlib
import os
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar

import numba

F = TypeVar("F", bound=Callable[..., Any])

_PACKAGE = Path(__file__).parent


def _source_digest() -> str:
    """Digest of every module with kernels, of the constants they use and of the compiler: names the cache folder."""
    digest = hashlib.blake2b(f"{numba.__version__} {sys.version_info[:2]}".encode(), digest_size=8)
    for path in sorted(_PACKAGE.rglob("*.py")):
        source = path.read_bytes()
        if b"_jit" in source or b"numba" in source or path.name in ("tolerances.py", "records.py"):
            digest.update(source)
    return digest.hexdigest()


def _cache_root() -> Path:
    """Inside the environment where that can be written, else in the user's cache folder."""
    prefix = Path(sys.prefix)
    if sys.prefix != sys.base_prefix and os.access(prefix, os.W_OK):
        return prefix / "var" / "cache" / "collision_monitor"
    base = os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache"
    return Path(base) / "collision_monitor"


if not os.environ.get("NUMBA_CACHE_DIR"):
    numba.config.CACHE_DIR = str(_cache_root() / _source_digest())

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


def kernel(function: F) -> F:
    """Compile a kernel that Python code calls with arrays."""
    compiled: F = numba.njit(**_OPTIONS)(function)
    return compiled


# Counting references to array arguments is atomic memory traffic: 300 ns for one pair of spheres, 18 ns without.
# So device functions only borrow their arrays: they must not allocate, and must return numbers, never an array.
_BORROWING: dict[str, Any] = {**_OPTIONS, "_nrt": False}


def device(function: F) -> F:
    """Compile a function that only kernels call; it borrows its arrays and returns numbers."""
    compiled: F = numba.njit(**_BORROWING)(function)
    return compiled


def inlined(function: F) -> F:
    """A device function that numba inlines into its callers: where arguments cost more to pass than to use."""
    compiled: F = numba.njit(inline="always", **_BORROWING)(function)
    return compiled


def parallel_kernel(function: F) -> F:
    """Compile a kernel whose `prange` loops run on all threads; each iteration must write places of its own."""
    # only what is written as a loop: numba would also move and merge loops across calls whose side effects it misses
    others = ("comprehension", "reduction", "inplace_binop", "setitem", "numpy", "stencil", "fusion")
    compiled: F = numba.njit(parallel=dict.fromkeys(others, False), **_OPTIONS)(function)
    return compiled
