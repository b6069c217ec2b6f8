"""The rules in force in words: what each of them limits, whom it covers at this moment, and what is missing for it."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from itertools import islice
from typing import Final, NamedTuple

from collision_monitor.alerts.rules import ANY, Rule, Rules
from collision_monitor.alerts.thresholds import LEVELS, LIMITS
from collision_monitor.codec.alerts import CollisionAlertArray
from collision_monitor.monitor.state.timeline import NANOSECOND

NAMED: Final = 50
"""Objects that a text names; it counts the others."""


class RuleInForce(NamedTuple):
    """name: of the rule. summary: whom it covers now. is_whole: it covers somebody, and all that it names is there.

    values: what else there is to know, by key, in the order to show it.
    """

    name: str
    summary: str
    is_whole: bool
    values: dict[str, str]


def rules_in_force(rules: Rules, array: CollisionAlertArray, name_of: Callable[[int], str]) -> list[RuleInForce]:
    """Return the rules with whom they cover by the array's coverage. name_of: of an object by id."""
    return [_in_force(rule, array, name_of) for rule in rules.rules]


def _in_force(rule: Rule, array: CollisionAlertArray, name_of: Callable[[int], str]) -> RuleInForce:
    if rule.is_of_plans:
        return RuleInForce(rule.name, f"covers the plans of {rule.between[0]}", True, rule_values(rule))
    own = [k for k, each in enumerate(array.coverage) if each.rule == rule.name]
    covered = []
    for k in own:
        side = array.coverage[k]
        if len(side.ids):
            against = "every other object" if side.against == ANY else side.against
            covered.append(f"{_named(side.ids.tolist(), name_of)} against {against}")
    missing = [each for each in array.unmonitored if set(each.coverage) & set(own)]
    texts = [f"{each.name}: {each.reason}" if each.is_silent else each.reason for each in missing]
    unfit = array.coverage[own[0]].unfit if own else ""
    values = {
        **rule_values(rule),
        "covers": "; ".join(covered) or "nobody",
        **({"not monitored": "; ".join(texts)} if texts else {}),
        **({"for a guard": unfit} if unfit else {}),
    }
    summary = f"covers {'; '.join(covered) or 'nobody'}"
    if texts:
        summary += f"; not monitored: {'; '.join(islice(texts, 3))}"
        summary += f" and {len(texts) - 3} more" if len(texts) > 3 else ""
    return RuleInForce(rule.name, summary, bool(covered) and not texts, values)


def rule_values(rule: Rule) -> dict[str, str]:
    """Return the keys of a rule with their values in words, in the order to show them."""
    delays = {
        "raise_after [s]": f"{rule.raise_after * NANOSECOND:g}",
        "clear_after [s]": f"{rule.clear_after * NANOSECOND:g}",
    }
    if rule.is_of_plans:
        return {"left_plan": rule.between[0], "level": LEVELS[rule.levels[0].level - 1], **delays}
    return {
        "between": " and ".join(rule.between),
        **{LEVELS[each.level - 1]: _thresholds(each.values) for each in rule.levels},
        **{side: ", ".join(names) for side, names in (("inside", rule.inside), ("outside", rule.outside)) if names},
        **delays,
        "quiet_at_rest": str(rule.quiet_at_rest).lower(),
        "quiet_when_parting": str(rule.quiet_when_parting).lower(),
    }


def _named(ids: Sequence[int], name_of: Callable[[int], str]) -> str:
    names = ", ".join(name_of(each) or f"object {each}" for each in ids[:NAMED])
    return f"{names} and {len(ids) - NAMED} more" if len(ids) > NAMED else names


def _thresholds(values: Mapping[str, float]) -> str:
    found = []
    for name, value in values.items():
        limit = LIMITS[name]
        found.append(f"{limit.text} {'at least' if limit.above else 'at most'} {value:g} {limit.unit}".strip())
    return ", ".join(found)
