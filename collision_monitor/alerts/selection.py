"""Which bodies and pairs a rule is about: classes, allowed pairs, and zones."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from collision_monitor.alerts.measures import Array, Measures, Slots
from collision_monitor.alerts.monitored_bodies import MonitoredBodies
from collision_monitor.alerts.rules import ANY, Rule, Rules
from collision_monitor.monitor.state.roster import Roster

Mask = NDArray[np.bool_]


class Classes:
    """Which body slots belong to which class. An object is matched again only if its name, id or group has changed."""

    def __init__(self, rules: Rules) -> None:
        self._rules = rules
        self._known: dict[int, tuple[int, str, int]] = {}  # by slot: id, name and group
        self._members: dict[str, Mask] = {}
        self._used = np.zeros(0, np.bool_)

    def update(self, roster: Roster) -> None:
        """Take over the descriptions that have changed."""
        top, bodies = roster.top, roster.bodies
        self._used = bodies.used[:top].copy()
        for name in (ANY, *self._rules.classes):
            members = np.zeros(top, np.bool_)
            before = self._members.get(name, members[:0])[:top]
            members[: len(before)] = before
            self._members[name] = members
        for slot in roster.used().tolist():
            object_id = int(bodies.id[slot])
            facts = object_id, roster.name(object_id), int(bodies.group[slot])
            if self._known.get(slot) == facts:
                continue
            self._known[slot] = facts
            self._members[ANY][slot] = True
            for name, each in self._rules.classes.items():
                self._members[name][slot] = each.has(*facts)

    def of(self, name: str) -> Mask:
        """Return the members of a class, by slot (top,). Objects that were removed may be among them."""
        return self._members[name]

    def described(self, name: str) -> Mask:
        """Return the members of a class that are described, by slot (top,)."""
        return np.asarray(self._members[name] & self._used)

    def without_members(self) -> list[str]:
        """Return the names of the classes that no object belongs to."""
        return [name for name in self._rules.classes if not self.described(name).any()]

    def orders(self, between: tuple[str, str], i: Slots, j: Slots) -> tuple[Mask, Mask]:
        """Return for each pair (n,) whether i is in the first class and j in the second, and the other way round."""
        first, second = map(self.of, between)
        return first[i] & second[j], first[j] & second[i]

    def of_pair(self, between: tuple[str, str], roster: Roster, key: int) -> tuple[str, str]:
        """Return the classes by which a rule selects the objects of a pair, in their order."""
        here, _ = self.orders(
            between, *(roster.find_slots(np.array([k], np.uint32)) for k in (key >> 32, key & 0xFFFFFFFF))
        )
        return between if here[0] else (between[1], between[0])


def select(rules: Rules, rule: Rule, classes: Classes, scene: MonitoredBodies, measures: Measures) -> Mask:
    """Return which of the pairs (n,) the rule is about."""
    i, j = measures.i, measures.j
    known = (i >= 0) & (j >= 0)
    here, there = classes.orders(rule.between, i, j)
    chosen = known & (here | there) & scene.present[i] & scene.present[j]
    for allowed in rules.allowed:
        here, there = classes.orders(allowed, i, j)
        chosen &= ~(here | there)
    if not (rule.inside or rule.outside) or not chosen.any():
        return chosen
    which = np.flatnonzero(chosen)
    i, j = i[which], j[which]
    if rule.inside:
        chosen[which] &= np.any([may_be_in_zone(rules, name, scene, i) for name in rule.inside], axis=0) | np.any(
            [may_be_in_zone(rules, name, scene, j) for name in rule.inside], axis=0
        )
    for name in rule.outside:
        chosen[which] &= ~(is_in_zone(rules, name, scene, i) & is_in_zone(rules, name, scene, j))
    return chosen


def may_be_in_zone(rules: Rules, zone: str, scene: MonitoredBodies, slots: Slots) -> Mask:
    """Return whether any part of these bodies may be in the zone."""
    return np.asarray(_distance(rules, zone, scene, slots) <= scene.radius[slots] + scene.doubt[slots])


def is_in_zone(rules: Rules, zone: str, scene: MonitoredBodies, slots: Slots) -> Mask:
    """Return whether these bodies are wholly in the zone."""
    return np.asarray(_distance(rules, zone, scene, slots) <= -(scene.radius[slots] + scene.doubt[slots]))


def _distance(rules: Rules, zone: str, scene: MonitoredBodies, slots: Slots) -> Array:
    return rules.zones[zone].distance(scene.position[slots])
