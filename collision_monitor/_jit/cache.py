"""Where compiled kernels are kept: one folder per content of a module and of all it imports.

numba looks at a kernel's own file only, so a change in a function that was inlined from another file would go unseen.
Here the folder's name is a digest of the module with everything of this package below it: a changed kernel can
never be answered by an old one, and what does not depend on it stays compiled.
"""

from __future__ import annotations

import functools
import hashlib
import os
import sys
from pathlib import Path

import numba

from collision_monitor._jit.imports import source_file, with_dependencies


@functools.cache
def _file_digest(module: str) -> bytes:
    path = source_file(module)
    return hashlib.blake2b(path.read_bytes(), digest_size=8).digest() if path else b""


@functools.cache
def folder(module: str) -> str:
    """The cache folder for the kernels of `module`, by its dotted name."""
    digest = hashlib.blake2b(f"{numba.__version__} {sys.version_info[:2]}".encode(), digest_size=8)
    for name in with_dependencies(module):
        digest.update(name.encode() + _file_digest(name))
    return str(_root() / digest.hexdigest())


def _root() -> Path:
    """Inside the environment where that can be written, else in the user's cache folder."""
    prefix = Path(sys.prefix)
    if sys.prefix != sys.base_prefix and os.access(prefix, os.W_OK):
        return prefix / "var" / "cache" / "collision_monitor"
    base = os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache"
    return Path(base) / "collision_monitor"
