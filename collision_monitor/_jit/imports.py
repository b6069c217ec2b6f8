"""Dependencies between the modules of this package, read from the source files without an import."""

from __future__ import annotations

import functools
import os
import re
import sys
from pathlib import Path

_PACKAGE = Path(__file__).parents[1]
_IMPORT = re.compile(
    rb"^\s*(?:from (collision_monitor[\w.]*) import (\([^)]*\)|[^\n]*)|import (collision_monitor[\w.]*))", re.MULTILINE
)


@functools.cache
def source_file(module: str) -> Path | None:
    """Return the file of a module of this package or of a loaded module, such as a benchmark; None if there is none."""
    base = f"{os.path.dirname(_PACKAGE)}/{module.replace('.', '/')}"
    loaded = getattr(sys.modules.get(module), "__file__", None)
    places = (f"{base}.py", f"{base}/__init__.py", *([loaded] if loaded else []))
    return next((Path(place) for place in places if os.path.isfile(place)), None)


@functools.cache
def direct_imports(module: str) -> frozenset[str]:
    """Return the modules of this package that `module` imports by name, anywhere in its file."""
    path = source_file(module)
    found: set[str] = set()
    for origin, names, plain in _IMPORT.findall(path.read_bytes()) if path else ():
        base = (origin or plain).decode()
        file = source_file(base)
        is_package = file is not None and file.name == "__init__.py"
        members = {f"{base}.{name}" for name in re.findall(r"\w+", names.decode())} if is_package else set()
        found.update({member for member in members if source_file(member)} or {base})
    return frozenset(found)


def with_dependencies(module: str) -> list[str]:
    """Return the module and all modules of this package that it imports, directly or indirectly, sorted by name."""
    found, queue = {module}, [module]
    while queue:
        new = direct_imports(queue.pop()) - found
        found |= new
        queue.extend(new)
    return sorted(found)
