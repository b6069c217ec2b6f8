"""Values of a setting for classes of objects, which patterns of their names define: "person*=4, pallet_?=1"."""

from __future__ import annotations

from fnmatch import fnmatchcase
from functools import lru_cache
from typing import Final

from collision_monitor.checks.numbers import checked_yaml_number
from collision_monitor.errors import ProfileError

MOST_CLASSES: Final = 64
MOST_TEXT: Final = 4096
"""Largest number of classes, and longest text (characters), of one setting; each new name is compared with all."""

Classes = tuple[tuple[str, float], ...]
"""Pattern of the names and value of each class. An object belongs to the first one that matches."""


@lru_cache(maxsize=MOST_CLASSES)
def classes_of(name: str, text: str) -> Classes:
    """Read the classes of the setting `name` from its text. Empty: none. Raises ProfileError."""
    wanted = f"{name}: expected patterns of names with a value each, such as 'person*=4, pallet_?=1'"
    if len(text) > MOST_TEXT:
        raise ProfileError(f"{wanted}, of at most {MOST_TEXT} characters, got {len(text)}")
    entries = [entry.strip() for entry in text.split(",")] if text.strip() else []
    if len(entries) > MOST_CLASSES:
        raise ProfileError(f"{wanted}, at most {MOST_CLASSES}, got {len(entries)}")
    found: dict[str, float] = {}
    for entry in entries:
        pattern, equals, value = (part.strip() for part in entry.rpartition("="))
        if not (pattern and equals):
            raise ProfileError(f"{wanted}, got {entry!r:.80}")
        if pattern in found:
            raise ProfileError(f"{wanted}, got the pattern {pattern!r:.80} twice")
        try:
            found[pattern] = float(value)
        except ValueError:
            raise ProfileError(f"{wanted}, got {entry!r:.80}") from None
    return tuple(found.items())


def checked_classes(name: str, text: object, least: float, most: float, unit: str) -> str:
    """Return the text of a setting after a check of each value. Raises ProfileError."""
    if not isinstance(text, str):
        raise ProfileError(f"{name}: expected a text such as 'person*=4, pallet_?=1', got {text!r:.80}")
    for pattern, value in classes_of(name, text):
        checked_yaml_number(value, f"{name}, {pattern}", unit, least=least, most=most, error=ProfileError)
    return text


def value_of(classes: Classes, name: str, otherwise: float) -> float:
    """Return the value of the class of a name, and `otherwise` without a class."""
    return next((value for pattern, value in classes if fnmatchcase(name, pattern)), otherwise)
