"""The code of cached functions: device functions as LLVM's intermediate code only, kernels as machine code.

numba makes machine code of every function, also of those that only kernels call, and optimises it again for each caller
up to the kernel. The machine code of a device function is never called, because its intermediate code is linked into
the kernel and optimised there as a whole. So a device function stops after LLVM's passes over single functions.
"""

from __future__ import annotations

from typing import Any

import llvmlite.binding as llvm
from numba.core.codegen import JITCodeLibrary
from numba.core.compiler import CompilerBase, DefaultPassBuilder


class DeviceLibrary(JITCodeLibrary):  # type: ignore[misc]
    """Intermediate code of a device function and of all that it calls, for linking into kernels."""

    @property
    def codegen(self) -> Any:
        """The code generator as numba's `get_executable` uses it."""
        return self

    def set_env(self, name: str, environment: Any) -> None:
        """Without machine code there is no place for the environment."""

    def get_pointer_to_function(self, name: str) -> int:
        """Return the null pointer: there is no machine code."""
        return 0

    def _optimize_final_module(self) -> None:
        pass

    def _finalize_final_module(self) -> None:
        self._finalize_dynamic_globals()
        self._finalized = True

    def serialize_using_object_code(self) -> tuple[str, bytes]:
        """Serialize the intermediate code; numba asks every library by this name."""
        return self.name, self._get_module_for_linking().as_bitcode()

    @classmethod
    def loaded(cls, codegen: Any, name: str, code: bytes) -> DeviceLibrary:
        """Make a library from its serialized form."""
        library = cls(codegen, name)
        library._final_module = llvm.parse_bitcode(code)
        library._finalize_final_module()
        return library


class DeviceCompiler(CompilerBase):  # type: ignore[misc]
    """Numba's compiler, which writes into a DeviceLibrary."""

    def define_pipelines(self) -> list[Any]:
        """Return numba's own passes; they use the library that they find."""
        state = self.state
        state.library = DeviceLibrary(state.targetctx.codegen(), state.func_id.func_qualname)
        return [DefaultPassBuilder.define_nopython_pipeline(state)]


class LoadedKernel(JITCodeLibrary):  # type: ignore[misc]
    """Machine code of a kernel from the cache. Its intermediate code is read only if a new kernel calls this one."""

    def __init__(self, codegen: Any, name: str, code: bytes, intermediate: bytes, symbols: list[str]) -> None:
        super().__init__(codegen, name)
        self._intermediate = intermediate
        self._shared_module: Any = None
        self.enable_object_caching()
        self._set_compiled_object(code)
        self._finalize_final_module()
        codegen._engine._defined_symbols.update(symbols)

    def _get_module_for_linking(self) -> Any:
        if self._shared_module is None:
            self._shared_module = llvm.parse_bitcode(self._intermediate)
        return self._shared_module
