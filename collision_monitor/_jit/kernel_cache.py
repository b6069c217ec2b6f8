"""Cache of one function: a file for each combination of argument types and processor, in the folder of its module.

numba's own cache first imports everything that a compilation needs (SciPy's linear algebra, 0.3 s) and checks the time
of the source file. Here the folder's name stands for the source (`cache.py`).
"""

from __future__ import annotations

import contextlib
import hashlib
import os
import pickle
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

from numba.core.caching import NullCache
from numba.core.compiler import CompileResult
from numba.core.runtime import rtsys
from numba.core.serialize import dumps

from collision_monitor._jit.cache import folder
from collision_monitor._jit.device_library import DeviceLibrary


class KernelCache(NullCache):  # type: ignore[misc]
    """Loads and saves the overloads of a function; what cannot be read is compiled again."""

    def __init__(self, function: Callable[..., Any]) -> None:
        self._folder = Path(folder(function.__module__))
        self._name = f"{function.__qualname__.replace('<locals>.', '')}-{function.__code__.co_firstlineno}"

    @property
    def cache_path(self) -> str:
        """The folder of the module's kernels."""
        return str(self._folder)

    def _file(self, signature: Any, target: Any) -> Path:
        types = getattr(signature, "args", signature)
        key = repr((tuple(types), target.codegen().magic_tuple()))
        return self._folder / f"{self._name}-{hashlib.blake2b(key.encode(), digest_size=8).hexdigest()}.kernel"

    def load_overload(self, sig: Any, target_context: Any) -> Any:
        """Return the compiled function, or None if it has to be compiled."""
        with contextlib.suppress(OSError, EOFError, ValueError, pickle.UnpicklingError):
            data = self._file(sig, target_context).read_bytes()
            digest, data = data[:16], data[16:]
            if hashlib.blake2b(data, digest_size=16).digest() == digest:  # not cut off by a full disk
                rtsys.initialize(target_context)
                return _rebuild(target_context, pickle.loads(data))
        target_context.refresh()
        return None

    def save_overload(self, sig: Any, data: Any) -> None:
        """Save a compiled function; a disk without space costs only the next compilation."""
        if data.library.has_dynamic_globals or any(not lifted.can_cache for lifted in data.lifted):
            return
        file = self._file(sig, data.target_context)
        content = dumps(data._reduce())
        with contextlib.suppress(OSError):
            file.parent.mkdir(parents=True, exist_ok=True)
            handle, temporary = tempfile.mkstemp(dir=file.parent, prefix=file.name)
            try:
                with os.fdopen(handle, "wb") as stream:
                    stream.write(hashlib.blake2b(content, digest_size=16).digest() + content)
                os.replace(temporary, file)
            except OSError:
                os.unlink(temporary)


def _rebuild(target: Any, content: Any) -> Any:
    """The compile result of a kernel as numba makes it; that of a device function without machine code."""
    code, fndesc, env, signature, objectmode, lifted, annotation, reload_init, environments = content
    if len(code) == 3:
        return CompileResult._rebuild(target, *content)
    library = DeviceLibrary.loaded(target.codegen(), *code)
    return CompileResult(
        target_context=target,
        typing_context=target.typing_context,
        library=library,
        environment=env,
        entry_point=target.get_executable(library, fndesc, env),
        fndesc=fndesc,
        type_annotation=annotation,
        signature=signature,
        objectmode=objectmode,
        lifted=lifted,
        typing_error=None,
        call_helper=None,
        metadata=None,
        reload_init=reload_init,
        referenced_envs=environments,
    )
