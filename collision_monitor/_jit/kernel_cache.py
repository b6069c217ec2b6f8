"""Cache of one function: a file for each combination of argument types and processor, in the folder of its module.

numba's own cache first imports everything that a compilation needs (SciPy's linear algebra, 0.3 s), compiles its
reference counting, and checks the time of the source file. Here the folder's name stands for the source (`cache.py`).
"""

from __future__ import annotations

import contextlib
import functools
import hashlib
import pickle
from collections.abc import Callable
from typing import Any, Final

import llvmlite.binding as llvm
from numba.core.caching import NullCache
from numba.core.compiler import CompileResult
from numba.core.runtime import _nrt_python
from numba.core.serialize import dumps

from collision_monitor._jit.cache import folder
from collision_monitor._jit.libraries import Callee, DeviceLibrary, LoadedKernel, OutlinedLibrary, callees
from collision_monitor._jit.places import is_trusted, kernel_places, read_kernel, write_kernel

_UNREADABLE: Final = (OSError, EOFError, ValueError, pickle.UnpicklingError, ImportError, AttributeError)
"""What reading a file of the cache raises; the last two if a class of its arguments has moved or is gone."""


class KernelCache(NullCache):  # type: ignore[misc]
    """Loads and saves the overloads of a function; what cannot be read is compiled again."""

    def __init__(self, function: Callable[..., Any], kind: str) -> None:
        self._function, self._kind = function, kind
        self._folder = folder(function.__module__)
        self._name = f"{function.__qualname__.replace('<locals>.', '')}-{function.__code__.co_firstlineno}"

    @property
    def cache_path(self) -> str:
        """The folder of the module's kernels, as numba's own caches say it."""
        return str(next(iter(kernel_places())) / self._folder)

    def _file(self, signature: Any, target: Any) -> str:
        types = getattr(signature, "args", signature)
        key = repr((tuple(types), target.codegen().magic_tuple()))
        digest = hashlib.blake2b(key.encode(), digest_size=8).hexdigest()
        return f"{self._name}-{digest}.{self._kind}"

    def load_overload(self, sig: Any, target_context: Any) -> Any:
        """Return the compiled function, or None if it has to be compiled."""
        file = self._file(sig, target_context)
        for place in kernel_places():
            if not is_trusted(place, self._folder):
                continue
            with contextlib.suppress(*_UNREADABLE):
                data = read_kernel(place / self._folder / file)
                digest, data = data[:16], data[16:]
                if hashlib.blake2b(data, digest_size=16).digest() == digest:  # not cut off by a full disk
                    compiled = _rebuild(target_context, pickle.loads(data))
                    if compiled is not None:
                        self._identify(sig, compiled)
                        return compiled
        target_context.refresh()
        return None

    def _identify(self, sig: Any, compiled: Any) -> None:
        """Note in the library of an outlined function what its callers have to load."""
        if isinstance(compiled.library, OutlinedLibrary):
            name, types = self._function.__qualname__, tuple(getattr(sig, "args", sig))
            compiled.library.itself = Callee(self._function.__module__, name, types, compiled.fndesc.mangled_name)

    def save_overload(self, sig: Any, data: Any) -> None:
        """Save a compiled function; without a place that can be written to, it lasts as long as this process."""
        self._identify(sig, data)
        data.library.callees = callees(data.library)
        if data.library.has_dynamic_globals or data.lifted:
            return
        file = self._file(sig, data.target_context)
        data.fndesc.typemap = data.fndesc.calltypes = None  # the types of all variables
        parts = (_code(data.library), data.fndesc, data.environment, data.signature, data.reload_init)
        content = dumps((data.library.callees, *parts))
        content = hashlib.blake2b(content, digest_size=16).digest() + content
        for place in kernel_places():
            with contextlib.suppress(OSError):
                write_kernel(place, self._folder, file, content)
                return


def _code(library: Any) -> tuple[Any, ...]:
    """Return the class that loads the code, and its arguments."""
    if isinstance(library, DeviceLibrary | OutlinedLibrary):
        return type(library).loaded, *library.serialize_using_object_code()
    name, _, (code, intermediate) = library.serialize_using_object_code()
    module = library._get_module_for_linking()
    symbols = [each.name for each in (*module.functions, *module.global_variables) if not each.is_declaration]
    return LoadedKernel, name, code, intermediate, symbols


@functools.cache
def _add_symbols() -> None:
    """Let LLVM find numba's functions for memory, which machine code calls by name."""
    for name, address in _nrt_python.c_helpers.items():
        llvm.add_symbol(name if name.startswith("_") else f"NRT_{name}", address)


def _rebuild(target: Any, content: tuple[Any, ...]) -> Any:
    """Make the compile result of a function again, with its own environment only; None if it calls other code by now.

    The environments of the functions inside belong to modules of numba that a compiled kernel does not need.
    """
    called, (make, *code), fndesc, environment, signature, reload_init = content
    if not all([each.load() for each in called]):
        return None
    for start in reload_init:  # the threads of a parallel kernel
        start()
    _add_symbols()
    library = make(target.codegen(), *code)
    library.callees = called
    return CompileResult(
        target_context=target,
        typing_context=target.typing_context,
        library=library,
        environment=environment,
        entry_point=target.get_executable(library, fndesc, environment),
        fndesc=fndesc,
        type_annotation="",
        signature=signature,
        objectmode=False,
        lifted=(),
        typing_error=None,
        call_helper=None,
        metadata=None,
        reload_init=reload_init,
        referenced_envs=(),
    )
