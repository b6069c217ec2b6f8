"""Cache folders of the compiled kernels: one folder for each content of a module and of all its imports.

numba only checks a kernel's own file, so it would miss a change in a function that was inlined from another file.
The folder's name is therefore a digest of the module and of everything in this package that it imports. A changed
kernel is always compiled again, and kernels that do not depend on the change stay compiled.
"""

from __future__ import annotations

import functools
import hashlib
import sys
from typing import Final

from collision_monitor._jit.imports import source_file, with_dependencies

NEUTRAL: Final = tuple(f"collision_monitor._jit.{name}" for name in ("cache", "compilation", "imports", "places"))
"""Modules that every kernel depends on and that change nothing in it: where it is kept, and what is said meanwhile."""


@functools.cache
def _file_digest(module: str) -> bytes:
    path = source_file(module)
    return hashlib.blake2b(path.read_bytes(), digest_size=8).digest() if path else b""


@functools.cache
def folder(module: str) -> str:
    """Return the name of the cache folder of the kernels of `module`, a dotted name, in each place (`places.py`)."""
    import numba

    digest = hashlib.blake2b(f"{numba.__version__} {sys.version_info[:2]}".encode(), digest_size=8)
    for name in with_dependencies(module):
        if name in NEUTRAL:
            continue
        digest.update(name.encode() + _file_digest(name))
    return digest.hexdigest()
