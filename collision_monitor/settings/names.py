"""Names for people: a hint for a misspelt one, and one line for a long one."""

from __future__ import annotations

import difflib
from collections.abc import Collection


def nearest_name(name: str, names: Collection[str]) -> str:
    """Return what an error adds about an unknown name: the nearest known one, or all of them."""
    near = difflib.get_close_matches(name, names, n=1)
    return f"did you mean {near[0]!r}?" if near else f"there are {', '.join(names) or 'none'}"


def shortened(name: str, longest: int = 18) -> str:
    """Return the name on one line. A long name keeps its beginning and end, where names often differ."""
    name = "".join(letter if letter.isprintable() else " " for letter in name)
    if len(name) <= longest:
        return name
    return f"{name[: longest // 2]}…{name[len(name) - longest // 2 + 1 :]}"
