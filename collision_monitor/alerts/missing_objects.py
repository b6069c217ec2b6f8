"""Objects that the rules name and no answer covers: those that are asked for and not there, and those that are silent.

Only the live node asks for it, so no replay depends on it.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Final, NamedTuple

import numpy as np

from collision_monitor.alerts.monitored_bodies import MonitoredBodies
from collision_monitor.alerts.name_patterns import may_name
from collision_monitor.alerts.rules import ANY, ObjectClass, Rules
from collision_monitor.alerts.selection import Classes
from collision_monitor.codec.alert_coverage import RuleCoverage, UnmonitoredObject
from collision_monitor.monitor.state.timeline import NANOSECOND

MOST: Final = 100
"""Objects that are listed one by one; the last element stands for the others."""


class MissingObject(NamedTuple):
    """Something that is asked for and not there. name: of the object, or with which names of its objects begin; empty:
    further ones, which may be any.

    reason: for people. since_ns: when that began.
    """

    name: str
    reason: str
    since_ns: int


class SilentObjects:
    """Finds the described objects without a usable new state, and remembers since when those without any are there."""

    def __init__(self) -> None:
        self._unseen: dict[int, int] = {}  # by id: stamp (ns) of the step that noticed it

    def look(self, scene: MonitoredBodies, stamp_ns: int) -> list[tuple[int, MissingObject]]:
        """Return slots and objects after a step at this stamp (ns), by slot."""
        b, top = scene.roster.bodies, scene.roster.top
        found, unseen = [], {}
        for slot in np.flatnonzero(b.used[:top] & scene.stale & ~b.static[:top]).tolist():
            object_id = int(b.id[slot])
            name = scene.roster.name(object_id) or f"object {object_id}"
            if b.seen[slot]:
                since = stamp_ns - round((scene.now - float(b.time[slot])) / NANOSECOND)
                found.append((slot, MissingObject(name, "no usable new state", since)))
            else:
                unseen[object_id] = self._unseen.get(object_id, stamp_ns)
                found.append((slot, MissingObject(name, "no state so far", unseen[object_id])))
        self._unseen = unseen
        return found


def unmonitored_objects(
    rules: Rules,
    classes: Classes,
    scene: MonitoredBodies,
    coverage: Sequence[RuleCoverage],
    missing: Iterable[MissingObject],
    silent: Iterable[tuple[int, MissingObject]],
) -> tuple[UnmonitoredObject, ...]:
    """Return what is missing and what is silent, each with the elements of the coverage that are compared with it."""
    found, described = [], {scene.roster.name(object_id): object_id for object_id in scene.roster.ids}
    listed = set()
    for each in missing:
        listed.add(each.name)
        if not each.name:
            found.append(UnmonitoredObject("", each.reason, each.since_ns, False, tuple(range(len(coverage)))))
            continue
        object_id = described.get(each.name)
        names = (
            {name for name, one in rules.classes.items() if may_belong(one, each.name)}
            if object_id is None
            else _classes_of(rules, classes, scene.roster.slot(object_id))
        )
        found.append(_as_message(rules, coverage, each, names, is_silent=False))
    for slot, each in silent:
        if each.name not in listed:
            found.append(_as_message(rules, coverage, each, _classes_of(rules, classes, slot), is_silent=True))
    if len(found) <= MOST:
        return tuple(found)
    first = min(each.since_ns for each in found[MOST:])
    text = f"{len(found) - MOST} further ones are not listed"
    return *found[:MOST], UnmonitoredObject("", text, first, False, tuple(range(len(coverage))))


def may_belong(one: ObjectClass, name: str) -> bool:
    """Return whether an object whose name begins so may belong to a class; ids and groups of it are not known."""
    return bool(one.ids or one.groups) or any(may_name(pattern, name) for pattern in one.patterns)


def _classes_of(rules: Rules, classes: Classes, slot: int) -> set[str]:
    return {name for name in rules.classes if classes.of(name)[slot]}


def _as_message(
    rules: Rules, coverage: Sequence[RuleCoverage], each: MissingObject, names: set[str], *, is_silent: bool
) -> UnmonitoredObject:
    own = {rule.name: rule.between for rule in rules.rules}
    indices = []
    for k, one in enumerate(coverage):
        if one.against != ANY and one.against not in names:
            continue
        first, second = own[one.rule]
        mine = first if one.against == second else second
        if not any(_is_allowed(pair, mine, names) for pair in rules.allowed):
            indices.append(k)
    return UnmonitoredObject(each.name, each.reason, each.since_ns, is_silent, tuple(indices))


def _is_allowed(pair: tuple[str, str], mine: str, names: set[str]) -> bool:
    """Return whether a pair of classes without alerts holds for all of a class and an object of these classes."""
    return any(a in (ANY, mine) and (b == ANY or b in names) for a, b in (pair, pair[::-1]))
