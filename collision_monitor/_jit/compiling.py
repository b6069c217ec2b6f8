"""Numba's dispatchers with our cache, and with intermediate code only for device functions."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numba

from collision_monitor._jit.kernel_cache import KernelCache
from collision_monitor._jit.libraries import DeviceCompiler


def make_dispatcher(function: Callable[..., Any], options: dict[str, Any], *, is_device: bool) -> Any:
    """Return numba's dispatcher of a function, with the cache of this package."""
    options = {**options, "no_cfunc_wrapper": True}
    if is_device:
        options |= {"no_cpython_wrapper": True, "pipeline_class": DeviceCompiler}
    dispatcher = numba.njit(**options)(function)
    if not numba.config.DISABLE_JIT:
        dispatcher._cache = KernelCache(function, is_device=is_device)
        # It looks for extensions of numba in all installed packages (20 ms). A compilation looks for them by itself.
        dispatcher._compilation_chain_init_hook = lambda: None
    return dispatcher
