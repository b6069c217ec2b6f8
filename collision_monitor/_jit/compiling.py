"""Dispatchers with our cache; device functions are compiled to LLVM's intermediate code only.

numba makes machine code of every function, also of those that only kernels call, and optimises it again for each
caller up to the kernel. The machine code of a device function is never called, because its intermediate code is linked
into the kernel and optimised there as a whole. So a device function stops after LLVM's passes over single functions.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numba
from numba.core.codegen import JITCodeLibrary
from numba.core.compiler import CompilerBase, DefaultPassBuilder

from collision_monitor._jit.kernel_cache import KernelCache


def make_dispatcher(function: Callable[..., Any], options: dict[str, Any], *, is_device: bool) -> Any:
    """Return numba's dispatcher of a function, with the cache of this package."""
    if is_device:
        options = {**options, "no_cpython_wrapper": True, "no_cfunc_wrapper": True, "pipeline_class": DeviceCompiler}
    dispatcher = numba.njit(**options)(function)
    if not numba.config.DISABLE_JIT:
        dispatcher._cache = KernelCache(function)
    return dispatcher


class DeviceLibrary(JITCodeLibrary):  # type: ignore[misc]
    """Intermediate code of a device function and of all that it calls, for linking into kernels."""

    @property
    def codegen(self) -> Any:
        """The code generator as numba's `get_executable` uses it: there is no machine code with an environment."""
        return _NoMachineCode()

    def _optimize_final_module(self) -> None:
        pass

    def _finalize_final_module(self) -> None:
        self._finalize_dynamic_globals()
        self._finalized = True

    def get_pointer_to_function(self, name: str) -> int:
        """Return the null pointer: there is no machine code."""
        return 0

    def serialize_using_object_code(self) -> tuple[str, str, bytes]:
        """Serialize the intermediate code (numba asks every library by this name)."""
        return self.name, "device", self._get_module_for_linking().as_bitcode()


class _NoMachineCode:
    def set_env(self, name: str, environment: Any) -> None:
        pass


class DeviceCompiler(CompilerBase):  # type: ignore[misc]
    """Numba's compiler with a DeviceLibrary."""

    def define_pipelines(self) -> list[Any]:
        """Return numba's own passes, which write into the library that they find."""
        state = self.state
        state.library = DeviceLibrary(state.targetctx.codegen(), state.func_id.func_qualname)
        return [DefaultPassBuilder.define_nopython_pipeline(state)]
