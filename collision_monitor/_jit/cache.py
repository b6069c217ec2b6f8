"""Cache folders of the compiled kernels: one folder for each content of a module and of all its imports.

numba only checks a kernel's own file, so it would miss a change in a function that was inlined from another file.
The folder's name is therefore a digest of the module and of everything in this package that it imports. A changed
kernel is always compiled again, and kernels that do not depend on the change stay compiled.
"""

from __future__ import annotations

import functools
import hashlib
import os
import sys
from pathlib import Path

from collision_monitor._jit.imports import source_file, with_dependencies


@functools.cache
def _file_digest(module: str) -> bytes:
    path = source_file(module)
    return hashlib.blake2b(path.read_bytes(), digest_size=8).digest() if path else b""


@functools.cache
def folder(module: str) -> str:
    """Return the cache folder of the kernels of `module`, a dotted name."""
    import numba

    digest = hashlib.blake2b(f"{numba.__version__} {sys.version_info[:2]}".encode(), digest_size=8)
    for name in with_dependencies(module):
        digest.update(name.encode() + _file_digest(name))
    return str(_root() / digest.hexdigest())


def _root() -> Path:
    """Return NUMBA_CACHE_DIR, or a folder in the virtual environment if it is writable, or one in the user's cache."""
    if chosen := os.environ.get("NUMBA_CACHE_DIR"):
        return Path(chosen)
    prefix = Path(sys.prefix)
    if sys.prefix != sys.base_prefix and os.access(prefix, os.W_OK):
        return prefix / "var" / "cache" / "collision_monitor"
    base = os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache"
    return Path(base) / "collision_monitor"
