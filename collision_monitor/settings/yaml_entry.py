"""One value of a YAML file with its place, so that an error names the file, the line and the key."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass
from typing import Any, Self

from collision_monitor.checks.numbers import checked_yaml_number
from collision_monitor.errors import InputError
from collision_monitor.settings.names import nearest_name
from collision_monitor.settings.yaml_file import NODES, Keys, parse_yaml, value_lines


@dataclass(frozen=True, eq=False)
class YamlEntry:
    """A value, and the keys and indices that lead to it. Every method raises InputError if the value does not fit."""

    value: Any
    file: str
    lines: Mapping[Keys, int]
    path: Keys = ()

    @classmethod
    def of_text(cls, text: str, file: str, nodes: int = NODES) -> Self:
        """Parse YAML. file: its name, for errors. nodes: most values."""
        value = parse_yaml(text, file, nodes=nodes)
        return cls(value, file, value_lines(text))

    @property
    def where(self) -> str:
        """File, line and keys, such as `rules.yaml, line 7, rules, 0, warning`."""
        line = self.lines.get(self.path)
        return ", ".join([self.file, *([f"line {line}"] if line else []), *map(str, self.path)])

    def error(self, expected: str, found: str | None = None) -> InputError:
        """Return the error for this value, to be raised."""
        return InputError(f"{self.where}: expected {expected}, got {f'{self.value!r:.80}' if found is None else found}")

    def unknown(self, name: str, names: Collection[str], what: str) -> InputError:
        """Return the error for an unknown name, with the nearest known one."""
        return InputError(f"{self.where}: the {what} {name!r:.80} is unknown: {nearest_name(name, names)}")

    def table(self, keys: Collection[str] | None = None) -> dict[str, Self]:
        """Return the entries of a table with these keys only; None: any texts."""
        if not isinstance(self.value, dict):
            raise self.error("a table" + (f" with {', '.join(keys)}" if keys else ""))
        found = {}
        for key, value in self.value.items():
            entry = type(self)(value, self.file, self.lines, (*self.path, key))
            if not isinstance(key, str) or not key:
                raise entry.error("a text as key", f"{key!r:.80}")
            if keys is not None and key not in keys:
                raise entry.unknown(key, keys, "key")
            found[key] = entry
        return found

    def items(self, least: int = 0, most: int = 1000) -> list[Self]:
        """Return the entries of a list."""
        if not isinstance(self.value, list) or not least <= len(self.value) <= most:
            size = f"{least}" if least == most else f"{least} to {most}"
            raise self.error(f"a list of {size}")
        return [type(self)(each, self.file, self.lines, (*self.path, k)) for k, each in enumerate(self.value)]

    def text(self) -> str:
        """Return a text that is not empty."""
        if not isinstance(self.value, str) or not self.value:
            raise self.error("a text")
        return self.value

    def truth(self) -> bool:
        """Return true or false."""
        if not isinstance(self.value, bool):
            raise self.error("true or false")
        return self.value

    def number(self, unit: str, least: float = 0.0, most: float = 1e9) -> float:
        """Return a number in a range."""
        return checked_yaml_number(self.value, self.where, unit, least=least, most=most)

    def numbers(self, count: int, unit: str) -> tuple[float, ...]:
        """Return a list of `count` numbers."""
        return tuple(each.number(unit, -1e9) for each in self.items(count, count))
