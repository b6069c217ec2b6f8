"""Numba's dispatchers with our cache and our libraries."""

from __future__ import annotations

import zlib
from collections.abc import Callable
from typing import Any

import numba
from numba.core.compiler import CompilerBase, DefaultPassBuilder
from numba.core.funcdesc import default_mangler, qualifying_prefix

from collision_monitor._jit.kernel_cache import KernelCache
from collision_monitor._jit.libraries import Library


def make_dispatcher(function: Callable[..., Any], options: dict[str, Any], *, is_device: bool) -> Any:
    """Return numba's dispatcher of a function, with the cache of this package."""
    if is_device:
        options = {**options, "no_cpython_wrapper": True, "no_cfunc_wrapper": True, "pipeline_class": DeviceCompiler}
    else:
        options = {**options, "no_cfunc_wrapper": True, "pipeline_class": KernelCompiler}
    dispatcher = numba.njit(**options)(function)
    if not numba.config.DISABLE_JIT:
        dispatcher._cache = KernelCache(function)
    return dispatcher


class KernelCompiler(CompilerBase):  # type: ignore[misc]
    """Numba's compiler, which writes into a Library."""

    is_device = False

    def define_pipelines(self) -> list[Any]:
        """Return numba's own passes; they use the library that they find."""
        state = self.state
        function = state.func_id.func
        # numba numbers the symbols in the order of the compilations, but machine code from the cache refers to them
        where = f"{function.__module__} {function.__qualname__} {function.__code__.co_firstlineno} {self.is_device}"
        state.func_id.unique_id = zlib.crc32(where.encode())
        symbol = default_mangler(
            qualifying_prefix(function.__module__, function.__qualname__), state.args,
            abi_tags=[state.flags.get_mangle_string()], uid=state.func_id.unique_id,
        )  # fmt: skip
        key = function.__module__, function.__qualname__, tuple(state.args), symbol
        name, inlines = state.func_id.func_qualname, bool(state.flags.forceinline)
        state.library = Library(state.targetctx.codegen(), name, key, is_device=self.is_device, inlines=inlines)
        return [DefaultPassBuilder.define_nopython_pipeline(state)]


class DeviceCompiler(KernelCompiler):
    """The same for functions that only kernels call."""

    is_device = True
