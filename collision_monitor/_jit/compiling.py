"""Numba's dispatchers with our cache, and with intermediate code only for device functions."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numba

from collision_monitor._jit.device_library import DeviceCompiler
from collision_monitor._jit.kernel_cache import KernelCache


def make_dispatcher(function: Callable[..., Any], options: dict[str, Any], *, is_device: bool) -> Any:
    """Return numba's dispatcher of a function, with the cache of this package."""
    options = {**options, "no_cfunc_wrapper": True}
    if is_device:
        options |= {"no_cpython_wrapper": True, "pipeline_class": DeviceCompiler}
    dispatcher = numba.njit(**options)(function)
    if not numba.config.DISABLE_JIT:
        dispatcher._cache = KernelCache(function)
    return dispatcher
