"""Hint for a misspelt name."""

from __future__ import annotations

import difflib
from collections.abc import Collection


def nearest_name(name: str, names: Collection[str]) -> str:
    """Return what an error adds about an unknown name: the nearest known one, or all of them."""
    near = difflib.get_close_matches(name, names, n=1)
    return f"did you mean {near[0]!r}?" if near else f"there are {', '.join(names) or 'none'}"
