"""Where compiled kernels are kept: one folder per content of a module and of all it imports.

numba looks at a kernel's own file only, so a change in a function that was inlined from another file would go unseen.
Here the folder's name is a digest of the module with everything of this package below it: a changed kernel can
never be answered by an old one, and what does not depend on it stays compiled.
"""

from __future__ import annotations

import functools
import hashlib
import os
import re
import sys
from pathlib import Path

import numba

_PACKAGE = Path(__file__).parents[1]
_IMPORT = re.compile(
    rb"^\s*(?:from (collision_monitor[\w.]*) import (\([^)]*\)|[^\n]*)|import (collision_monitor[\w.]*))", re.MULTILINE
)


def _path(module: str) -> Path | None:
    """The module's file: one of this package, or one that was started or imported, such as a benchmark."""
    base = _PACKAGE.parent.joinpath(*module.split("."))
    loaded = getattr(sys.modules.get(module), "__file__", None)
    candidates = [base.with_suffix(".py"), base / "__init__.py", *([Path(loaded)] if loaded else [])]
    return next((path for path in candidates if path.is_file()), None)


@functools.cache
def _imports(module: str) -> frozenset[str]:
    """The modules of this package that `module` imports by name."""
    path = _path(module)
    found: set[str] = set()
    for origin, names, plain in _IMPORT.findall(path.read_bytes()) if path else ():
        base = (origin or plain).decode()
        members = {f"{base}.{name}" for name in re.findall(r"\w+", names.decode())}
        found.update({member for member in members if _path(member)} or {base})
    return frozenset(found)


@functools.cache
def _file_digest(module: str) -> bytes:
    path = _path(module)
    return hashlib.blake2b(path.read_bytes(), digest_size=8).digest() if path else b""


@functools.cache
def folder(module: str) -> str:
    """The cache folder for the kernels of `module`, by its dotted name."""
    below, queue = {module}, [module]
    while queue:
        new = _imports(queue.pop()) - below
        below |= new
        queue.extend(new)
    digest = hashlib.blake2b(f"{numba.__version__} {sys.version_info[:2]}".encode(), digest_size=8)
    for name in sorted(below):
        digest.update(name.encode() + _file_digest(name))
    return str(_root() / digest.hexdigest())


def _root() -> Path:
    """Inside the environment where that can be written, else in the user's cache folder."""
    prefix = Path(sys.prefix)
    if sys.prefix != sys.base_prefix and os.access(prefix, os.W_OK):
        return prefix / "var" / "cache" / "collision_monitor"
    base = os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache"
    return Path(base) / "collision_monitor"
