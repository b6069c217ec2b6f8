"""Names of objects with wildcards, as rules and the guard take them."""

from __future__ import annotations

import re
from fnmatch import fnmatchcase
from typing import Final

_WILDCARD: Final = re.compile(r"[*?\[]")

_PARTS: Final = ("_", "/")
"""What separates the name of a line of the sources file from the rest of the names of its objects."""


def matches(pattern: str, name: str) -> bool:
    """Return whether a pattern with the wildcards *, ? and [] matches a name; capital letters count."""
    return fnmatchcase(name, pattern)


def may_name(pattern: str, stem: str) -> bool:
    """Return whether a pattern may match an object of this name, or one of a group whose names begin with it.

    In doubt it does: `traffic*`, `t*` and `traffic_7` may match one of the group `traffic`.
    """
    if fnmatchcase(stem, pattern):
        return True
    wildcard = _WILDCARD.search(pattern)
    begin = pattern[: wildcard.start()] if wildcard else pattern
    stems = [f"{stem}{each}" for each in _PARTS]
    return begin.startswith(tuple(stems)) or (wildcard is not None and any(each.startswith(begin) for each in stems))
