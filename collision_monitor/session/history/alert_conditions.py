"""Conditions about the alerts of a session: which were raised, to which level, and when."""

from __future__ import annotations

from collections.abc import Callable, Iterator

from collision_monitor.alerts.thresholds import LEVELS
from collision_monitor.codec import CollisionAlert
from collision_monitor.errors import InputError
from collision_monitor.session.history.conditions import Condition, PairSelector
from collision_monitor.session.history.history import History


def alert_within(names: PairSelector, rule: str, level: int, low: float, high: float) -> Condition:
    """Require that the first alert of these objects at `level` or above is raised in this window (s)."""

    def check(history: History, _: Callable[[], str]) -> tuple[bool, str]:
        for time, alert in _raised(history, names, rule, level):
            return low <= time <= high, f"first alert {_text(time, alert)}"
        return False, _unknown(history) or "no such alert"

    return check


def no_alert(names: PairSelector, rule: str, level: int) -> Condition:
    """Require that no alert of these objects reaches `level`."""

    def check(history: History, _: Callable[[], str]) -> tuple[bool, str]:
        for time, alert in _raised(history, names, rule, level):
            return False, f"alert {_text(time, alert)}"
        unknown = _unknown(history)
        return not unknown, unknown or "no such alert"

    return check


def _raised(history: History, names: PairSelector, rule: str, level: int) -> Iterator[tuple[float, CollisionAlert]]:
    """Yield the changes from below `level` to it or above, in order. Raises InputError for an unknown rule."""
    known = [each.name for each in history.rules.rules] or sorted({alert.rule for _, alert in history.alerts})
    if rule and rule not in known:
        raise InputError(f"expected the name of a rule, one of {', '.join(known) or 'none'}; got {rule!r}")
    wanted = history.pairs_of(names)
    for time, alert in history.alerts:
        rises = alert.previous_level < level <= alert.level
        if rises and rule in ("", alert.rule) and wanted((alert.id_a, alert.id_b)):
            yield time, alert


def _unknown(history: History) -> str:
    """Return why it is not known that there was no alert; empty if it is known."""
    if not history.rules.rules and not history.alerts:
        return "not known: the session has no rules; give some with --rules"
    return f"not known: {history.problems[0]}" if history.problems else ""


def _text(time: float, alert: CollisionAlert) -> str:
    return f"at {time:.3f} s, {LEVELS[alert.level - 1]}, rule {alert.rule}: {alert.text}"
