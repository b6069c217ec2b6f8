"""A team's expectations of a session, as YAML, and their evaluation: regression tests from recordings.

Only what the session shows counts as true. If inputs or answers are missing, an expectation that something did not
happen counts as not known, and fails.
"""

from __future__ import annotations

import math
import sys
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final

from collision_monitor.alerts.thresholds import LEVELS
from collision_monitor.errors import CollisionMonitorError, InputError
from collision_monitor.session.history.alert_conditions import alert_within, no_alert
from collision_monitor.session.history.conditions import (
    Condition,
    PairSelector,
    complete,
    first_contact_within,
    no_contact,
    no_prediction_under,
    step_time_within,
    warned_before,
)
from collision_monitor.session.history.history import ANY, History
from collision_monitor.settings.yaml_file import read_yaml


@dataclass(frozen=True)
class ExpectationResult:
    """Result of one expectation: its text, whether it holds, what was found, and the time to find it (s)."""

    expectation: str
    holds: bool
    found: str
    seconds: float = field(default=0.0, compare=False)


@dataclass(frozen=True)
class Expectation:
    """Text and condition of an expectation."""

    text: str
    condition: Condition


def read_expectations(path: str | Path) -> Any:
    """Return the content of a YAML file for `parse_expectations`.

    Raises InputError with the file, the expectation and the choices.
    """
    content = read_yaml(Path(path))
    try:
        parse_expectations(content)
    except InputError as error:
        raise InputError(f"{path}: {error}") from None
    return content


def parse_expectations(content: Any) -> list[Expectation]:
    """Return the expectations in the content from `read_yaml`. Raises InputError."""
    if not isinstance(content, Mapping) or list(content) != ["expect"] or not isinstance(content["expect"], list):
        raise InputError(f"expected a list under the one key `expect`, got {content!r:.80}")
    if not content["expect"]:
        raise InputError("expected at least one expectation under `expect`, got none")
    return [_parse(k, each) for k, each in enumerate(content["expect"], start=1)]


def evaluate_expectations(
    expectations: list[Expectation], history: History, replay: Callable[[], str]
) -> list[ExpectationResult]:
    """Return the result of each expectation. replay: replays the session and returns its verdict, if that is needed."""
    outcomes = []
    for each in expectations:
        begin = time.perf_counter()
        try:
            holds, found = each.condition(history, replay)
        except CollisionMonitorError as error:
            holds, found = False, str(error)
        outcomes.append(ExpectationResult(each.text, holds, found, time.perf_counter() - begin))
    return outcomes


# -- from YAML to conditions

_OPTIONS: Final[dict[str, tuple[str, ...]]] = {
    "contact": ("between",),
    "no_contact": (),
    "no_prediction": ("under",),
    "warned": ("before",),
    "alert": ("level", "rule", "between"),
    "no_alert": ("level", "rule"),
    "step_time_p99": (),
    "replay": (),
    "complete": (),
}


def _parse(number: int, item: Any) -> Expectation:
    what = f"expectation {number}"
    kinds = [key for key in item if key in _OPTIONS] if isinstance(item, Mapping) else []
    if len(kinds) != 1:
        raise InputError(f"{what}: expected one of {', '.join(_OPTIONS)}, got {item!r}")
    kind = kinds[0]
    unknown = set(item) - {kind, *_OPTIONS[kind]}
    if unknown:
        choices = ", ".join((kind, *_OPTIONS[kind]))
        raise InputError(f"{what}: expected only {choices}, got {', '.join(map(str, sorted(unknown, key=str)))}")
    text = ", ".join(f"{key}: {_shown(value)}" for key, value in item.items())
    match kind:
        case "contact":
            low, high = _window(item.get("between"), what)
            return Expectation(text, first_contact_within(_names(item[kind], what), low, high))
        case "no_contact":
            return Expectation(text, no_contact(_names(item[kind], what)))
        case "no_prediction":
            return Expectation(
                text, no_prediction_under(_names(item[kind], what), _number(item.get("under", math.inf), what))
            )
        case "warned":
            return Expectation(text, warned_before(_names(item[kind], what), _number(item.get("before"), what)))
        case "alert" | "no_alert":
            names, rule, level = _names(item[kind], what), item.get("rule", ""), _level(item, what)
            if not isinstance(rule, str):
                raise InputError(f"{what}: rule: expected the name of a rule, got {rule!r}")
            if kind == "no_alert":
                return Expectation(text, no_alert(names, rule, level))
            return Expectation(text, alert_within(names, rule, level, *_window(item.get("between"), what)))
        case "step_time_p99":
            return Expectation(text, step_time_within(_number(item[kind], what)))
        case "replay":
            if item[kind] != "identical":
                raise InputError(f"{what}: replay: expected identical, got {item[kind]!r}")
            return Expectation(text, lambda history, replay: ((found := replay()) == "identical", found))
    if item[kind] is not True:
        raise InputError(f"{what}: complete: expected true, got {item[kind]!r}")
    return Expectation(text, complete)


def _level(item: Mapping[str, Any], what: str) -> int:
    name = item.get("level", LEVELS[0])
    if name not in LEVELS:
        raise InputError(f"{what}: level: expected one of {', '.join(LEVELS)}, got {name!r}")
    return LEVELS.index(name) + 1


def _shown(value: Any) -> str:
    if isinstance(value, list):
        return f"[{', '.join(map(_shown, value))}]"
    return str(value).lower() if isinstance(value, bool) else str(value)


def _names(value: Any, what: str) -> PairSelector:
    if value == ANY or (isinstance(value, list) and len(value) == 2 and all(_is_name(name) for name in value)):
        return value  # type: ignore[no-any-return]
    raise InputError(f"{what}: expected two names or ids, [cart, 7], or {ANY}; got {value!r}")


def _is_name(value: Any) -> bool:
    return isinstance(value, str | int) and not isinstance(value, bool)


def _number(value: Any, what: str) -> float:
    is_number = isinstance(value, int | float) and not isinstance(value, bool)
    if not (is_number and (value == math.inf or 0.0 <= value <= sys.float_info.max)):
        raise InputError(f"{what}: expected a number of seconds, at least 0, got {value!r}")
    return float(value)


def _window(value: Any, what: str) -> tuple[float, float]:
    if value is None:
        return 0.0, math.inf
    if not isinstance(value, list) or len(value) != 2:
        raise InputError(f"{what}: between: expected [from, to] in seconds, got {value!r}")
    low, high = _number(value[0], what), _number(value[1], what)
    if low > high:
        raise InputError(f"{what}: between: expected a window that does not end before it begins, got {value!r}")
    return low, high
