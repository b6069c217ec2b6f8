"""The code of cached functions: device functions as LLVM's intermediate code only, the others as machine code.

numba makes machine code of every function, also of those that only kernels call, and optimises it again for each caller
up to the kernel. The machine code of a device function is never called, because its intermediate code is linked into
the kernel and optimised there as a whole. So a device function stops after LLVM's passes over single functions.

An outlined function is the opposite: its machine code is made once, and the kernels refer to it by its symbol.
"""

from __future__ import annotations

import hashlib
import importlib
from typing import Any, Final, NamedTuple

import llvmlite.binding as llvm
from numba.core.codegen import JITCodeLibrary
from numba.core.compiler import CompilerBase, DefaultPassBuilder
from numba.core.funcdesc import default_mangler

from collision_monitor._jit.cache import folder


class Callee(NamedTuple):
    """An outlined function whose machine code a library calls."""

    module: str
    name: str
    types: tuple[Any, ...]  # of the arguments
    symbol: str

    def load(self) -> bool:
        """Load it into this process, or compile it. Return whether it then has the symbol that its callers know."""
        dispatcher = getattr(importlib.import_module(self.module), self.name).dispatcher
        dispatcher.compile(self.types)
        return bool(dispatcher.overloads[self.types].fndesc.mangled_name == self.symbol)


def callees(library: Any) -> list[Callee]:
    """Return the outlined functions that a library calls, also through the device functions inside."""
    found = dict.fromkeys(getattr(library, "callees", ()))
    for each in library._linking_libraries:
        found |= dict.fromkeys([each.itself] if isinstance(each, OutlinedLibrary) else callees(each))
    return list(found)


class WholeLibrary(JITCodeLibrary):  # type: ignore[misc]
    """Code of a function with all functions inside of it, which no other library calls.

    Because LLVM knows that, it drops the arguments that they do not read. An array is seven numbers, most of them
    unread, and a kernel's tuples of arrays are passed on the stack: the steps of `clutter` with 1,000 noisy objects
    took 1.3 times as long. They are private, not internal: other code would find an internal one by its name.
    """

    def _optimize_final_module(self) -> None:
        for function in self._final_module.functions:
            if not function.is_declaration and function.linkage == llvm.Linkage.linkonce_odr:
                function.linkage = llvm.Linkage.private
        super()._optimize_final_module()


class _WithoutEntry(WholeLibrary):
    """Code of a function that Python cannot call."""

    @property
    def codegen(self) -> Any:
        """The code generator as numba's `get_executable` uses it."""
        return self

    def set_env(self, name: str, environment: Any) -> None:
        """There is no entry that needs the environment."""

    def get_pointer_to_function(self, name: str) -> int:
        """Return the null pointer: there is no entry."""
        self._ensure_finalized()
        return 0


class DeviceLibrary(_WithoutEntry):
    """Intermediate code of a device function and of all that it calls, for linking into kernels."""

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


class OutlinedLibrary(_WithoutEntry):
    """Machine code of a device function that kernels call by its symbol. Nothing is linked into them."""

    itself: Callee

    def __init__(self, codegen: Any, name: str) -> None:
        super().__init__(codegen, name)
        self._shared_module = llvm.parse_assembly(str(codegen._create_empty_module(name)))
        self.enable_object_caching()

    def serialize_using_object_code(self) -> tuple[str, bytes]:
        """Serialize the machine code."""
        return self.name, self._get_compiled_object()

    @classmethod
    def loaded(cls, codegen: Any, name: str, code: bytes) -> OutlinedLibrary:
        """Make a library from its serialized form."""
        library = cls(codegen, name)
        library._set_compiled_object(code)
        library._finalize_final_module()
        return library


LONGEST_SYMBOL: Final = 160
"""Characters of a symbol, behind which a digest stands for the types of the arguments."""


def _short_mangler(name: str, types: Any, *, abi_tags: Any = (), uid: Any = None) -> str:
    """The symbol of a function. numba spells the types of all members of a tuple, those of the bodies in 3,300 letters.

    Each kernel repeats that for each function inside, in machine code, intermediate code and texts of errors: three
    quarters of the bytes of all kernels.
    """
    whole: str = default_mangler(name, types, abi_tags=abi_tags, uid=uid)
    if len(whole) <= LONGEST_SYMBOL:
        return whole
    digest = hashlib.blake2b(whole.encode(), digest_size=12).hexdigest()
    short: str = default_mangler(name, (), abi_tags=(*abi_tags, digest), uid=uid)
    return short


class KernelCompiler(CompilerBase):  # type: ignore[misc]
    """Numba's compiler, which writes into a WholeLibrary."""

    def define_pipelines(self) -> list[Any]:
        """Return numba's own passes; they use the library that they find."""
        state = self.state
        state.targetctx.mangler = _short_mangler  # of a copy that this compilation has for itself
        state.library = WholeLibrary(state.targetctx.codegen(), state.func_id.func_qualname)
        state.library.enable_object_caching()
        return [DefaultPassBuilder.define_nopython_pipeline(state)]


class DeviceCompiler(CompilerBase):  # type: ignore[misc]
    """Numba's compiler, which writes into a DeviceLibrary."""

    def define_pipelines(self) -> list[Any]:
        """Return numba's own passes; they use the library that they find."""
        state = self.state
        state.targetctx.mangler = _short_mangler  # of a copy that this compilation has for itself
        state.library = DeviceLibrary(state.targetctx.codegen(), state.func_id.func_qualname)
        return [DefaultPassBuilder.define_nopython_pipeline(state)]


class OutlinedCompiler(CompilerBase):  # type: ignore[misc]
    """Numba's compiler, which writes into an OutlinedLibrary."""

    def define_pipelines(self) -> list[Any]:
        """Return numba's own passes, for a symbol that is the same in every process with the same source."""
        state = self.state
        state.targetctx.mangler = _short_mangler  # of a copy that this compilation has for itself
        state.func_id.unique_id = folder(state.func_id.modname)
        state.library = OutlinedLibrary(state.targetctx.codegen(), state.func_id.func_qualname)
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
