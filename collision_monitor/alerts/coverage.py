"""Whom the rules cover at a step, and what they leave out: what a guard has to know besides the alerts.

Only the live node asks for it, so no replay depends on it.
"""

from __future__ import annotations

from collections.abc import Mapping
from math import inf
from typing import Final

import numpy as np
from numpy.typing import NDArray

from collision_monitor.alerts.measures import Measures
from collision_monitor.alerts.monitored_bodies import MonitoredBodies
from collision_monitor.alerts.rules import ANY, Rule, Rules
from collision_monitor.alerts.selection import Classes, is_in_zone, may_be_in_zone
from collision_monitor.alerts.thresholds import APPROACH
from collision_monitor.codec.alert_coverage import RuleCoverage
from collision_monitor.records import HELD_BACK

Mask = NDArray[np.bool_]

_HOLDING: Final = frozenset(("distance", APPROACH[0], "separation_margin"))
"""Measures that two objects which stand near each other pass as well."""

_AHEAD: Final = ("time_to_collision", "time_headway")
"""Thresholds in s that a pair passes before it meets, as it moves now."""


def rule_coverage(rules: Rules, classes: Classes, scene: MonitoredBodies) -> tuple[RuleCoverage, ...]:
    """Return one element for each side of each rule that names a class, and for a rule between any two.

    Rules about plans have none: they compare no objects.
    """
    found = []
    for rule in rules.rules:
        if rule.is_of_plans:
            continue
        first, second = rule.between
        sides = {(first, second): None, (second, first): None}  # ordered, once each
        for own, against in sides:
            if own == ANY and against != ANY:
                continue
            slots = np.flatnonzero(_covered(rules, rule, classes, scene, own, against))
            ids = np.sort(scene.roster.bodies.id[slots]).astype(np.uint32)
            horizon = scene.profile.horizon
            found.append(RuleCoverage(rule.name, against, ids, _reach(rule), _ahead(rule, horizon), _unfit(rule)))
    return tuple(found)


def _covered(rules: Rules, rule: Rule, classes: Classes, scene: MonitoredBodies, own: str, against: str) -> Mask:
    """Return which bodies (N,) of a class the rule compares with all of the other class."""
    covered = classes.of(own) & scene.present
    others = classes.described(against)
    for a, b in rules.allowed:
        for mine, theirs in ((a, b), (b, a)):
            left = others & ~classes.of(theirs)
            if theirs in (ANY, against) or (others.any() and not left.any()):
                covered &= ~classes.of(mine)
    slots = np.arange(len(covered), dtype=np.int32)
    if rule.inside:
        covered &= np.any([may_be_in_zone(rules, name, scene, slots) for name in rule.inside], axis=0)
    for name in rule.outside:
        covered &= ~is_in_zone(rules, name, scene, slots)
    return _checked(scene, covered, others)


def _checked(scene: MonitoredBodies, covered: Mask, others: Mask) -> Mask:
    """Return which of the covered bodies (N,) the monitor checks against any of the others, if there are others."""
    b, top = scene.roster.bodies, scene.roster.top
    group, mask = b.group[:top], b.mask[:top]
    kinds, own, count = np.unique(
        np.stack([group[others], mask[others]], axis=1), axis=0, return_inverse=True, return_counts=True
    )
    meets = ((group[:, None] & kinds[:, 1]) != 0) & ((mask[:, None] & kinds[:, 0]) != 0)
    rows = np.flatnonzero(others)  # of which each is one of the others itself
    meets[rows, own] &= count[own] > 1
    has_others = np.count_nonzero(others) > others
    return np.asarray(covered & (meets.any(axis=1) | ~has_others))


def _reach(rule: Rule) -> float:
    return max((level.values.get("distance", 0.0) for level in rule.levels), default=0.0)


def _ahead(rule: Rule, horizon: float) -> float:
    if rule.separation is not None:
        return inf
    times = [min(level.values[name], horizon) for level in rule.levels for name in _AHEAD if name in level.values]
    for level in rule.levels:
        if APPROACH[0] in level.values:
            times.append(min(level.values.get(APPROACH[1], horizon), horizon))
    return max(times, default=0.0)


def _unfit(rule: Rule) -> str:
    """Return why two objects that stand near each other pass no threshold of the rule; empty if they do."""
    if rule.measures & _HOLDING:
        return ""
    return f"it has no threshold on {', '.join(sorted(_HOLDING))}, so it does not see what stands near"


def held_back_pairs(
    rules: Rules, measured: Mapping[str, Measures], raised: Mapping[tuple[str, int, int], int]
) -> NDArray[np.void]:
    """Return the pairs (HELD_BACK) that pass a threshold above the level of their alert, by (rule, id_a, id_b).

    measured: of the last step, by rule. raised: level of each alert, by rule and ids.
    """
    parts = []
    for number, rule in enumerate(rules.rules):
        found = measured.get(rule.name)
        if found is None or rule.is_of_plans or not (reached := found.reached).any():
            continue
        which = np.flatnonzero(reached)
        keys = found.keys[which]
        pairs = zip((keys >> np.uint64(32)).tolist(), (keys & np.uint64(0xFFFFFFFF)).tolist(), strict=True)
        level = np.array([raised.get((rule.name, *pair), 0) for pair in pairs], np.uint8)
        which = which[reached[which] > level]
        rows = np.zeros(len(which), HELD_BACK)
        for name in ("time_to_collision", "distance", "closing_speed"):
            rows[name] = found[name][which]
        rows["point_a"], rows["point_b"] = found.points[which, 0], found.points[which, 1]
        rows["id_a"], rows["id_b"] = found.keys[which] >> np.uint64(32), found.keys[which] & np.uint64(0xFFFFFFFF)
        rows["rule"], rows["level"] = number, reached[which]
        parts.append(rows)
    return np.concatenate(parts) if parts else np.zeros(0, HELD_BACK)
