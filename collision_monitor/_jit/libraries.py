"""Machine code and intermediate code of compiled functions: what is made of each, and what is linked into what.

numba makes machine code of every function and, for each caller up to the kernel, optimises and translates a copy again:
the narrow phase 14 times. Here a small device function is intermediate code alone, which LLVM inlines into its callers.
A large one, which LLVM never inlines, becomes machine code once; its callers refer to it by name.
"""

from __future__ import annotations

from typing import Any, Final

import llvmlite.binding as llvm
from numba.core.codegen import JITCodeLibrary

LARGE: Final = 24_000
"""Bytes of intermediate code (before what it calls) from which a device function is machine code of its own. Larger:
more copies are compiled. Smaller: functions become calls that LLVM would inline."""

Reference = tuple[str, str, Any, str]


class Library(JITCodeLibrary):  # type: ignore[misc]
    """Code of a kernel, or of a device function if `is_device`.

    refers_to: (module, name, argument types, symbol) of the functions with machine code of their own that it calls.
    """

    def __init__(self, codegen: Any, name: str, key: Reference, *, is_device: bool, inlines: bool) -> None:
        super().__init__(codegen, name)
        self.enable_object_caching()
        self.key = key
        self.is_device = is_device
        self.has_machine_code = not is_device
        self.refers_to: dict[Reference, None] = {}
        self._inlines = inlines

    def finalize(self) -> None:
        """Link what it calls; optimise and translate a kernel and a large device function."""
        if self.is_device and not self._inlines:
            self.has_machine_code = len(self._final_module.as_bitcode()) > LARGE
        for library in self._linking_libraries:
            self.refers_to |= references(library)
        super().finalize()

    @property
    def codegen(self) -> Any:
        """The code generator as numba's `get_executable` uses it."""
        return self._codegen if self.has_machine_code else self

    def set_env(self, name: str, environment: Any) -> None:
        """Without machine code there is no place for the environment."""

    def get_pointer_to_function(self, name: str) -> int:
        """Return the address of a function, or the null pointer."""
        return super().get_pointer_to_function(name) if self.has_machine_code else 0

    def _optimize_final_module(self) -> None:
        if self.has_machine_code:
            super()._optimize_final_module()

    def _finalize_final_module(self) -> None:
        if self.has_machine_code:
            super()._finalize_final_module()
        else:
            self._finalize_dynamic_globals()
            self._finalized = True

    def _get_module_for_linking(self) -> Any:
        if self.is_device and self.has_machine_code:
            return empty_module(self._codegen)
        return super()._get_module_for_linking()

    def serialize_using_object_code(self) -> Any:
        """Serialize for the cache; numba asks every library by this name."""
        code = self._get_compiled_object() if self.has_machine_code else b""
        linked = b"" if self.is_device and self.has_machine_code else self._get_module_for_linking().as_bitcode()
        return self.name, self.key, list(self.refers_to), code, linked


class LoadedLibrary(JITCodeLibrary):  # type: ignore[misc]
    """Code from the cache. It parses no intermediate code unless a compilation links it."""

    def __init__(self, codegen: Any, name: str, key: Any, refers_to: list[Any], code: bytes, linked: bytes) -> None:
        super().__init__(codegen, name)
        self._finalized = True
        self.key = key
        self.refers_to = dict.fromkeys(refers_to)
        self.has_machine_code = bool(code)
        self.is_device = not (code and linked)
        self._linked = linked
        self._module: Any = None
        if code:
            codegen._engine._ee.add_object_file(llvm.ObjectFileRef.from_data(code))

    @property
    def codegen(self) -> Any:
        """The code generator as numba's `get_executable` uses it."""
        return self._codegen if self.has_machine_code else self

    def set_env(self, name: str, environment: Any) -> None:
        """Without machine code there is no place for the environment."""

    def get_pointer_to_function(self, name: str) -> int:
        """Return the address of a function, or the null pointer."""
        if not self.has_machine_code or self.is_device:
            return 0
        address: int = self._codegen._engine.get_function_address(name)
        return address

    def _get_module_for_linking(self) -> Any:
        if self._module is None:
            self._module = llvm.parse_bitcode(self._linked) if self._linked else empty_module(self._codegen)
        return self._module


def references(library: Any) -> dict[Reference, None]:
    """The functions with machine code of their own that code with this library linked into it refers to."""
    if getattr(library, "is_device", False) and library.has_machine_code:
        return {library.key: None}
    found: dict[Reference, None] = getattr(library, "refers_to", {})
    return found


def empty_module(codegen: Any) -> Any:
    """A module without functions: nothing is linked."""
    return llvm.parse_assembly(str(codegen._create_empty_module("")))
