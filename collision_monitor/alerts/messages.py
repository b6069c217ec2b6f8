"""Writes the changes of alerts as messages."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any, Final, NamedTuple

import numpy as np

from collision_monitor.alerts.measures import COLUMNS, Measures
from collision_monitor.alerts.rules import Rule
from collision_monitor.alerts.thresholds import LEVELS
from collision_monitor.codec.alerts import AlertCause, CollisionAlert
from collision_monitor.monitor.state.timeline import NANOSECOND

NameOf = Callable[[int], str]

_UNKNOWN: Final = (np.nan, np.nan, np.nan)


class AlertChange(NamedTuple):
    """The change of one alert: the pair's key, its levels, the stamp at which it rose from 0 (ns), and why.

    classes: by which the rule selects the pair; empty after the end of an object or of the rule.
    """

    key: int
    level: int
    previous: int
    since_ns: int
    cause: AlertCause
    classes: tuple[str, str] = ("", "")


class Head(NamedTuple):
    """What all messages of a step have in common. name_of: of an object by id."""

    stamp_ns: int
    frame_id: str
    step: int
    name_of: NameOf


def message(
    head: Head, number: int, rule: str, change: AlertChange, of: tuple[Rule, Measures] | None
) -> CollisionAlert:
    """Return the message of a change. of: the rule and its measures of the step; None: the rule is there no more."""
    id_a, id_b = change.key >> 32, change.key & 0xFFFFFFFF
    names = head.name_of(id_a), head.name_of(id_b)
    at = -1 if of is None else _find(of[1], change.key)
    reason = _reason(head, change, of, at)
    return CollisionAlert(
        head.stamp_ns,
        head.frame_id,
        head.step,
        number,
        change.since_ns,
        **_values(None if of is None else of[1], at),
        id_a=id_a,
        id_b=id_b,
        level=change.level,
        previous_level=change.previous,
        cause=int(change.cause),
        rule=rule,
        name_a=names[0],
        name_b=names[1],
        class_a=change.classes[0],
        class_b=change.classes[1],
        text=f"{names[0] if id_a == id_b else f'{names[0]} and {names[1]}'}: {reason}",
    )


def measured(alert: CollisionAlert, measures: Measures | None) -> CollisionAlert:
    """Return the alert with these measures; without them, if its pair is not among them."""
    if measures is None:
        return alert
    return replace(alert, **_values(measures, _find(measures, alert.id_a << 32 | alert.id_b)))


def _values(measures: Measures | None, at: int) -> dict[str, Any]:
    """Return the measures of the pair with that index as fields of the message; NaN without a pair."""
    if measures is None or at < 0:
        return {**dict.fromkeys(COLUMNS, np.nan), "point_a": _UNKNOWN, "point_b": _UNKNOWN}
    points = measures.points[at].tolist()
    numbers = {name: float(measures[name][at]) for name in COLUMNS}
    return {**numbers, "point_a": tuple(points[0]), "point_b": tuple(points[1])}


def _find(measures: Measures, key: int) -> int:
    at = int(np.searchsorted(measures.keys, np.uint64(key)))
    return at if at < len(measures) and measures.keys[at] == key else -1


def _reason(head: Head, change: AlertChange, of: tuple[Rule, Measures] | None, at: int) -> str:
    lasted = f"after {(head.stamp_ns - change.since_ns) * NANOSECOND:.2f} s"
    if change.cause is AlertCause.REMOVED:
        return f"ended {lasted}, because {'the rule' if of is None else 'an object'} was removed"
    if not change.level:
        return f"cleared {lasted}"
    assert of is not None
    rule, measures = of
    if rule.is_of_plans:
        return "has left its plan"
    thresholds = [each for each in rule.levels if each.level == change.level and at >= 0]
    reasons = ", ".join(each.reasons(measures, at) for each in thresholds)
    doubt = " (not settled, or stale)" if change.cause is AlertCause.UNRESOLVED else ""
    return (reasons or f"no longer {LEVELS[change.previous - 1]}") + doubt
