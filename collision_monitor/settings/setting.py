"""A setting: its kind, range, unit and description, and the check of a value.

ROS parameters, custom profiles and recorded changes all pass this check, so that their errors have the same text.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import MISSING, dataclass, field, fields
from typing import Any, Final

from collision_monitor.errors import ProfileError
from collision_monitor.settings.by_name import checked_classes
from collision_monitor.tolerances import LARGEST_INPUT

Vector = tuple[float, float, float]
Value = bool | int | float | str | Vector

EVERYWHERE: Final = LARGEST_INPUT
"""m: a region with this value as a bound is unbounded on that side."""

_KINDS: dict[type, str] = {bool: "true or false", int: "a whole number", float: "a number", tuple: "three numbers"}
_UNITS = {"s": "seconds", "ms": "milliseconds", "m": "metres", "rad": "radians"}


def number_setting(
    default: float | int,
    minimum: float | int,
    maximum: float | int,
    unit: str,
    description: str,
    *,
    predictions: bool = False,
) -> Any:
    """Return a field of a profile: a number, whole if its default is whole."""
    metadata = {"minimum": minimum, "maximum": maximum, "unit": unit, "description": description}
    return field(default=default, metadata={**metadata, "predictions": predictions})


def vector_setting(default: Vector, largest: float, unit: str, description: str) -> Any:
    """Return a field of a profile: x, y and z, each from -largest to largest."""
    metadata = {"minimum": -largest, "maximum": largest, "unit": unit, "description": description}
    return field(default=default, metadata=metadata)


def switch(default: bool, description: str, *, predictions: bool = False) -> Any:
    """Return a field of a profile: on or off."""
    return field(default=default, metadata={"description": description, "predictions": predictions})


def choice(choices: Iterable[str], description: str) -> Any:
    """Return a field of a profile: one of some words, the first by default."""
    words = tuple(choices)
    return field(default=words[0], metadata={"choices": words, "description": description})


def by_name(minimum: float, maximum: float, unit: str, description: str, *, predictions: bool = False) -> Any:
    """Return a field of a profile: numbers for classes of objects, by patterns of their names; empty by default."""
    metadata = {"minimum": minimum, "maximum": maximum, "unit": unit, "description": description}
    return field(default="", metadata={**metadata, "predictions": predictions})


@dataclass(frozen=True)
class Setting:
    """One field of a profile, for parameter declarations and checks. minimum and maximum apply to numbers only.

    predictions: whether predictions depend on it, so that a change computes all of them anew.
    """

    name: str
    type: type
    default: Value
    description: str
    minimum: float | int = -math.inf
    maximum: float | int = math.inf
    unit: str = "1"
    choices: tuple[str, ...] = ()
    predictions: bool = False

    def checked(self, value: Any) -> Value:
        """Return the value in the setting's type. Raises ProfileError, which names what was expected."""
        if self.choices:
            if not isinstance(value, str) or value not in self.choices:
                raise ProfileError(f"{self.name}: expected one of {', '.join(self.choices)}, got {value!r}")
            return str(value)
        if self.type is tuple:
            return self._checked_vector(value)
        if self.type is str:
            return checked_classes(self.name, value, self.minimum, self.maximum, self.unit)
        whole = isinstance(value, int) and not isinstance(value, bool)
        fits = {bool: isinstance(value, bool), int: whole, float: whole or isinstance(value, float)}[self.type]
        if not fits:
            raise ProfileError(f"{self.name}: expected {_KINDS[self.type]}{self._of_unit}, got {value!r}")
        self._check_range(value)
        return self.type(value)  # type: ignore[no-any-return]

    def _checked_vector(self, value: Any) -> Vector:
        given = list(value) if isinstance(value, Sequence) and not isinstance(value, str) else []
        if len(given) != 3 or not all(isinstance(x, int | float) and not isinstance(x, bool) for x in given):
            raise ProfileError(f"{self.name}: expected {_KINDS[tuple]}{self._of_unit}, got {value!r}")
        for x in given:
            self._check_range(x)
        return (float(given[0]), float(given[1]), float(given[2]))

    def _check_range(self, value: float) -> None:
        if not self.minimum <= value <= self.maximum:
            wanted = f"{self.minimum:g} to {self.maximum:g}{self._in_unit}"
            raise ProfileError(f"{self.name}: expected {wanted}, got {value!r:.100}")

    @property
    def _of_unit(self) -> str:
        return "" if self.unit == "1" else f" of {_UNITS.get(self.unit, self.unit)}"

    @property
    def _in_unit(self) -> str:
        return "" if self.unit == "1" else f" {self.unit}"


def settings_of(kind: type) -> list[Setting]:
    """Return the settings among the fields of a dataclass, in order."""
    return [
        Setting(name=f.name, type=type(f.default), default=f.default, **f.metadata)
        for f in fields(kind)
        if f.metadata and f.default is not MISSING
    ]
