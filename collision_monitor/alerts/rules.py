"""The rules of alerts, as a YAML text: who against whom, at which thresholds, where, and how steady.

collision-monitor run --rules config/rules.yaml
"""

from __future__ import annotations

import fnmatch
import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Final, Self

from collision_monitor.alerts.protective_separation import ProtectiveSeparation, read_protective_separation
from collision_monitor.alerts.thresholds import FROM_ANSWERS, LEVELS, Thresholds, read_levels
from collision_monitor.alerts.zones import Zone, read_zone
from collision_monitor.errors import InputError
from collision_monitor.settings.yaml_entry import YamlEntry
from collision_monitor.settings.yaml_file import read_text

ANY: Final = "any"
"""The class of all objects."""

MOST: Final = 100
"""Rules, classes, zones, patterns of a class and allowed pairs of a file: a step evaluates each of them."""

MOST_PATTERNS: Final = 1000
"""Members of all classes of a file together."""

MOST_WILDCARDS: Final = 2000
"""Of `*`, `?` and `[` in all of them."""

LONGEST_PATTERN: Final = 256
"""Characters of a member. A name has 256 bytes at most."""

LARGEST: Final = 1 << 16
"""Bytes of a text. One hundred rules have 10 KB. The limits keep reading below 100 ms, in which a running monitor is
silent."""

_VALUES: Final = 5000
"""Values in a text: one hundred rules have 2,000."""

_PLAN_RULE: Final = ("left_plan", "level", "raise_after", "clear_after")

_RULE: Final = (
    *("between", *LEVELS, "raise_after", "clear_after", "quiet_at_rest", "quiet_when_parting"),
    *("inside", "outside", "protective_separation"),
)


@dataclass(frozen=True)
class ObjectClass:
    """Objects by name, id or group. patterns: of the names. groups: bits of ObjectDescription.group."""

    name: str
    patterns: tuple[str, ...]
    ids: frozenset[int]
    groups: int

    def has(self, object_id: int, name: str, group: int) -> bool:
        """Return whether an object belongs to the class."""
        is_named = self._pattern is not None and self._pattern.match(name) is not None
        return is_named or object_id in self.ids or bool(group & self.groups)

    @cached_property
    def _pattern(self) -> re.Pattern[str] | None:
        return re.compile("|".join(map(fnmatch.translate, self.patterns))) if self.patterns else None


@dataclass(frozen=True)
class Rule:
    """One rule. between: two classes. levels: from the lowest on. Times in ns. inside, outside: names of zones.

    quiet_at_rest, quiet_when_parting: whether pairs that rest, or that move apart without touching, are left out.
    is_of_plans: it is about each object of the first class that has left its plan, not about pairs.
    """

    name: str
    between: tuple[str, str]
    levels: tuple[Thresholds, ...]
    raise_after: int = 0
    clear_after: int = 0
    quiet_at_rest: bool = True
    quiet_when_parting: bool = True
    inside: tuple[str, ...] = ()
    outside: tuple[str, ...] = ()
    separation: ProtectiveSeparation | None = None
    is_of_plans: bool = False

    @property
    def measures(self) -> frozenset[str]:
        """Names of the measures that the thresholds limit."""
        return frozenset(name for level in self.levels for name in level.values)

    @property
    def needs_states(self) -> bool:
        """Whether it limits more than contacts and predictions tell."""
        return not self.measures <= set(FROM_ANSWERS)


@dataclass(frozen=True)
class Rules:
    """The rules in force. text: the YAML that they were read from; a session holds it. Empty text: no rules."""

    text: str = ""
    classes: Mapping[str, ObjectClass] = field(default_factory=dict)
    allowed: tuple[tuple[str, str], ...] = ()
    zones: Mapping[str, Zone] = field(default_factory=dict)
    rules: tuple[Rule, ...] = ()

    @property
    def longest_time(self) -> float:
        """The longest time (s) ahead that a threshold asks for; 0: none."""
        names = ("time_to_collision", "time_to_closest_approach")
        levels = [level.values for rule in self.rules for level in rule.levels]
        return max((values.get(name, 0.0) for values in levels for name in names), default=0.0)

    @classmethod
    def parse(cls, text: str, file: str = "rules") -> Self:
        """Read the rules of a YAML text; a blank text has none. file: for errors.

        Raises InputError with the file and the line.
        """
        if not text.strip():
            return cls()
        if (size := len(text.encode("utf-8", "surrogatepass"))) > LARGEST:
            raise InputError(f"{file}: expected rules of at most {LARGEST} bytes, got {size}")
        entry = YamlEntry.of_text(text, file, _VALUES)
        top = entry.table(("classes", "allowed", "zones", "rules"))
        found = {} if "classes" not in top else _bounded(top["classes"])
        _check_members(found.values())
        classes = {name: _read_class(name, each) for name, each in found.items()}
        zones = {} if "zones" not in top else {name: read_zone(each) for name, each in _bounded(top["zones"]).items()}
        pairs = top["allowed"].items(most=MOST) if "allowed" in top else []
        allowed = tuple(_read_pair(each, classes) for each in pairs)
        if "rules" not in top:
            raise entry.error("a table `rules`", f"{', '.join(top) or 'none'}")
        rules = tuple(_read_rule(name, each, classes, zones) for name, each in _bounded(top["rules"]).items())
        return cls(text, classes, allowed, zones, rules)

    @classmethod
    def given(cls, value: str) -> Self:
        """Read the parameter `rules`: the path of a file, or the YAML itself, which has a colon and a line break or a
        brace. Raises InputError."""
        if "\n" in value or "{" in value:
            return cls.parse(value)
        return cls.parse(read_text(Path(value), LARGEST), value) if value else cls()


def _check_members(classes: Iterable[YamlEntry]) -> None:
    """Compare the members of all classes with the limits, before one of them is compiled. Raises InputError."""
    members = wildcards = 0
    for each in classes:
        for member in each.items(1, MOST):
            members += 1
            if isinstance(member.value, str):
                wildcards += sum(map(member.value.count, "*?["))
                if len(member.value) > LONGEST_PATTERN:
                    raise member.error(f"a name of at most {LONGEST_PATTERN} characters", f"{len(member.value)}")
            if members > MOST_PATTERNS or wildcards > MOST_WILDCARDS:
                limits = f"at most {MOST_PATTERNS} members of all classes with {MOST_WILDCARDS} of * ? [ together"
                raise member.error(limits, "more")


def _bounded(entry: YamlEntry) -> dict[str, YamlEntry]:
    table = entry.table()
    if len(table) > MOST:
        raise entry.error(f"at most {MOST}", f"{len(table)}")
    for name, each in table.items():
        if len(name) > MOST:
            raise each.error(f"a name of at most {MOST} characters", f"{len(name)}")
    return table


def _read_class(name: str, entry: YamlEntry) -> ObjectClass:
    if name == ANY:
        raise entry.error(f"another name, because {ANY!r} is every object", repr(name))
    patterns, ids, groups = [], set(), 0
    for each in entry.items(1, MOST):
        if isinstance(each.value, dict):
            given = each.table(("group",))
            if not given:
                raise each.error("a name, an id or {group: BITS}")
            groups |= _whole(given["group"])
        elif isinstance(each.value, int):
            ids.add(_whole(each))
        else:
            patterns.append(each.text())
    return ObjectClass(name, tuple(patterns), frozenset(ids), groups)


def _whole(entry: YamlEntry) -> int:
    if isinstance(entry.value, bool) or not isinstance(entry.value, int) or not 0 <= entry.value < 1 << 32:
        raise entry.error("a whole number from 0 to 4294967295")
    return entry.value


def _read_pair(entry: YamlEntry, classes: Mapping[str, ObjectClass]) -> tuple[str, str]:
    a, b = entry.items(2, 2)
    for each in (a, b):
        if each.text() not in (ANY, *classes):
            raise each.unknown(each.text(), (ANY, *classes), "class")
    return a.text(), b.text()


def _read_between(entry: YamlEntry, classes: Mapping[str, ObjectClass]) -> tuple[str, str]:
    if entry.value == ANY:
        return ANY, ANY
    if isinstance(entry.value, str):
        raise entry.error(f"two classes, or `{ANY}`")
    return _read_pair(entry, classes)


def _read_rule(name: str, entry: YamlEntry, classes: Mapping[str, ObjectClass], zones: Mapping[str, Zone]) -> Rule:
    if isinstance(entry.value, dict) and "left_plan" in entry.value:
        return _read_plan_rule(name, entry.table(_PLAN_RULE), classes)
    content = entry.table(_RULE)
    if "between" not in content:
        raise entry.error("the key `between` with two classes", "none")
    levels = read_levels(entry, content)
    limits = {measure for level in levels for measure in level.values}
    if ("separation_margin" in limits) != ("protective_separation" in content):
        raise entry.error(
            "`protective_separation` and a level with `separation_margin`, or neither",
            "only `protective_separation`" if "protective_separation" in content else "only `separation_margin`",
        )
    inside, outside = (_zone_names(content[key], zones) if key in content else () for key in ("inside", "outside"))
    for each in set(inside) & set(outside):
        raise content["outside"].error("other zones than those of `inside`", repr(each))
    return Rule(
        name,
        _read_between(content["between"], classes),
        levels,
        raise_after=_delay(content, "raise_after"),
        clear_after=_delay(content, "clear_after"),
        quiet_at_rest="quiet_at_rest" not in content or content["quiet_at_rest"].truth(),
        quiet_when_parting="quiet_when_parting" not in content or content["quiet_when_parting"].truth(),
        inside=inside,
        outside=outside,
        separation=read_protective_separation(content["protective_separation"])
        if "protective_separation" in content
        else None,
    )


def _read_plan_rule(name: str, content: Mapping[str, YamlEntry], classes: Mapping[str, ObjectClass]) -> Rule:
    """Read a rule about objects that have left their plans."""
    of = content["left_plan"]
    if of.text() not in (ANY, *classes):
        raise of.unknown(of.text(), (ANY, *classes), "class")
    level = content["level"].text() if "level" in content else LEVELS[1]
    if level not in LEVELS:
        raise content["level"].unknown(level, LEVELS, "level")
    return Rule(
        name,
        (of.text(), of.text()),
        (Thresholds(LEVELS.index(level) + 1, {}),),
        raise_after=_delay(content, "raise_after"),
        clear_after=_delay(content, "clear_after"),
        is_of_plans=True,
    )


def _delay(content: Mapping[str, YamlEntry], key: str) -> int:
    return round(content[key].number("s", 0.0, 3600.0) * 1e9) if key in content else 0


def _zone_names(entry: YamlEntry, zones: Mapping[str, Zone]) -> tuple[str, ...]:
    names = tuple(each.text() for each in entry.items(1, MOST))
    for name in names:
        if name not in zones:
            raise entry.unknown(name, zones, "zone")
    return names
