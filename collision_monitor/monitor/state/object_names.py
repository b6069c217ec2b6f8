"""Objects that are given by their names in place of their ids."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

from collision_monitor.errors import InputError


def ids_named(known: Mapping[int, str], names: Iterable[str]) -> list[int]:
    """Id of the object of each name. known: the names by id. Raises InputError for a name that not exactly one has."""
    found: dict[str, list[int]] = {}
    for object_id, name in known.items():
        found.setdefault(name, []).append(object_id)
    ids = []
    for name in names:
        having = found.get(name, [])
        if len(having) != 1:
            others = ", ".join(map(repr, list(found)[:5])) or "none"
            got = f"ids {having[:5]} have it" if having else f"there are {others}"
            raise InputError(f"expected the name of one object, got {name!r}: {got}")
        ids += having
    return ids
