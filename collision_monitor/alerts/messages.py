"""Writes the changes of alerts as messages."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Final, NamedTuple

import numpy as np

from collision_monitor.alerts.measures import COLUMNS, Measures
from collision_monitor.alerts.rules import Rule
from collision_monitor.alerts.thresholds import LEVELS
from collision_monitor.codec.alerts import AlertCause, CollisionAlert
from collision_monitor.monitor.timeline import NANOSECOND

NameOf = Callable[[int], str]

_UNKNOWN: Final = (np.nan, np.nan, np.nan)


class Change(NamedTuple):
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


def message(head: Head, number: int, rule: str, change: Change, of: tuple[Rule, Measures] | None) -> CollisionAlert:
    """Return the message of a change. of: the rule and its measures of the step; None: the rule is there no more."""
    id_a, id_b = change.key >> 32, change.key & 0xFFFFFFFF
    names = head.name_of(id_a), head.name_of(id_b)
    at = -1 if of is None else _find(of[1], change.key)
    values: dict[str, Any] = dict.fromkeys(COLUMNS, np.nan)
    points = _UNKNOWN, _UNKNOWN
    if of is not None and at >= 0:
        values = {name: float(of[1][name][at]) for name in COLUMNS}
        points = tuple(of[1].points[at, 0].tolist()), tuple(of[1].points[at, 1].tolist())
    reason = _reason(head, change, of, at)
    return CollisionAlert(
        head.stamp_ns,
        head.frame_id,
        head.step,
        number,
        change.since_ns,
        **values,
        point_a=points[0],
        point_b=points[1],
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
        text=f"{names[0]} and {names[1]}: {reason}",
    )


def _find(measures: Measures, key: int) -> int:
    at = int(np.searchsorted(measures.keys, np.uint64(key)))
    return at if at < len(measures) and measures.keys[at] == key else -1


def _reason(head: Head, change: Change, of: tuple[Rule, Measures] | None, at: int) -> str:
    lasted = f"after {(head.stamp_ns - change.since_ns) * NANOSECOND:.2f} s"
    if change.cause is AlertCause.REMOVED:
        return f"ended {lasted}, because {'the rule' if of is None else 'an object'} was removed"
    if not change.level:
        return f"cleared {lasted}"
    assert of is not None
    rule, measures = of
    thresholds = [each for each in rule.levels if each.level == change.level and at >= 0]
    reasons = ", ".join(each.reasons(measures, at) for each in thresholds)
    doubt = " (not settled, or stale)" if change.cause is AlertCause.UNRESOLVED else ""
    return (reasons or f"no longer {LEVELS[change.previous - 1]}") + doubt
