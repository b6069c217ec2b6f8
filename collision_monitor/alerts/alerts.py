"""The alerts of a monitor: after each step, one message for each alert that rises, changes or clears."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from collision_monitor.alerts.answered import answered
from collision_monitor.alerts.coverage import held_back_pairs, rule_coverage
from collision_monitor.alerts.debounce import ENTRY, Conditions, Delays, Entries, advance_entries, lasting, restart
from collision_monitor.alerts.evaluation import evaluate_rule
from collision_monitor.alerts.measures import Measures, Slots
from collision_monitor.alerts.messages import AlertChange, Head, NameOf, measured, message
from collision_monitor.alerts.missing_objects import MissingObject, SilentObjects, unmonitored_objects
from collision_monitor.alerts.monitored_bodies import MonitoredBodies
from collision_monitor.alerts.rules import Rule, Rules
from collision_monitor.alerts.selection import Classes
from collision_monitor.codec.alerts import AlertCause, CollisionAlert, CollisionAlertArray
from collision_monitor.impact.body_impact import make_scratch
from collision_monitor.impact.impact_record import ids_of_keys
from collision_monitor.monitor.monitor import Monitor
from collision_monitor.monitor.result import StepResult
from collision_monitor.monitor.state.roster import Roster
from collision_monitor.monitor.state.snapshot import Facts, Snapshot

_ARRAY: Final = "alerts"
"""Begin of the keys in a snapshot; the number of the rule follows."""


class Alerts:
    """Evaluates rules, and remembers which alerts are raised. All depends on the steps and their stamps alone.

    rules: those in force. are_used: whether there ever were any. number: count of the messages so far.
    """

    def __init__(self, rules: Rules | None = None) -> None:
        self.rules = rules or Rules()
        self.are_used = bool(self.rules.text)
        self.number = 0
        self._classes = Classes(self.rules)
        self._is_outdated = True  # objects were described or removed since the classes were updated
        self._entries: dict[str, Entries] = {rule.name: _none() for rule in self.rules.rules}
        self._gone: dict[str, Entries] = {}  # of rules that were taken out, until the next step
        self._last: list[int] | None = None  # stamp (ns) of the last step, and number of restarts of the timeline
        self._raised: dict[tuple[str, int, int], CollisionAlert] = {}
        self._measured: dict[str, Measures] = {}  # by each rule in the last step
        self._scratch = make_scratch()
        self._silent = SilentObjects()

    def use(self, rules: Rules) -> None:
        """Use these rules from the next step on. The alerts of a rule whose name stays go on; the others end."""
        before, self.rules, self.are_used = {**self._gone, **self._entries}, rules, True
        self._entries = {rule.name: before.pop(rule.name, _none()) for rule in rules.rules}
        self._gone = before
        self._classes, self._is_outdated = Classes(rules), True

    def forget_classes(self) -> None:
        """Look again which objects belong to which classes, because objects were described or removed."""
        self._is_outdated = True

    def empty_classes(self, roster: Roster) -> list[str]:
        """Return the classes of the rules that no object belongs to."""
        self._update_classes(roster)
        return self._classes.without_members()

    def raised(self, stamp_ns: int, frame_id: str, step: int) -> CollisionAlertArray:
        """Return all alerts that are raised, with the measures of the last step.

        After a restart from a snapshot, only those that have changed since then.
        """
        now = [measured(each, self._measured.get(each.rule)) for each in self._raised.values()]
        alerts = sorted(now, key=lambda each: (-each.level, each.rule, each.id_a, each.id_b))
        highest = alerts[0].level if alerts else 0
        return CollisionAlertArray(stamp_ns, frame_id, step, self.number, highest, tuple(alerts))

    def for_guards(
        self, raised: CollisionAlertArray, monitor: Monitor, missing: Iterable[MissingObject] = (), number: int = 0
    ) -> CollisionAlertArray:
        """Return the raised alerts with what a guard needs besides: whom the rules cover, and what they leave out.

        missing: what is asked for and not there. number: of the monitor. No replay depends on this.
        """
        scene = self._scene(monitor)
        coverage = rule_coverage(self.rules, self._classes, scene)
        levels = {(each.rule, each.id_a, each.id_b): each.level for each in raised.alerts}
        silent = self._silent.look(scene, raised.stamp_ns) if monitor.last is not None else []
        return replace(
            raised,
            monitor=number,
            held_back=held_back_pairs(self.rules, self._measured, levels),
            rule_names=tuple(rule.name for rule in self.rules.rules),
            coverage=coverage,
            unmonitored=unmonitored_objects(self.rules, self._classes, scene, coverage, missing, silent),
        )

    def _scene(self, monitor: Monitor) -> MonitoredBodies:
        """Return the bodies now, with the classes of all of them known."""
        self._update_classes(monitor.roster)
        now = 0.0 if monitor.last is None else monitor.now
        return MonitoredBodies(monitor.roster, monitor.profile, now, self._scratch, monitor.off_plan)

    def _update_classes(self, roster: Roster) -> None:
        if self._is_outdated:
            self._classes.update(roster)
            self._is_outdated = False

    # ------------------------------------------------------------------ steps

    def step(self, monitor: Monitor, result: StepResult, frame_id: str, name_of: NameOf) -> list[CollisionAlert]:
        """Return the alerts that a step changes, by rule and pair. Without rules this costs nothing."""
        if not (self.rules.rules or self._gone):
            return []
        scene = self._scene(monitor)
        self._follow_time(result.stamp_ns, monitor.restarts)
        head = Head(result.stamp_ns, frame_id, result.step, name_of)
        made = [
            each for name, entries in self._gone.items() for each in self._messages(head, name, None, _ended(entries))
        ]
        self._gone = {}
        answers = answered(scene, result)
        for rule in self.rules.rules:
            found, changes = self._advance(rule, scene, answers, result.stamp_ns)
            self._measured[rule.name] = found
            made += self._messages(head, rule.name, (rule, found), changes)
        return made

    def _follow_time(self, now: int, restarts: int) -> None:
        if self._last is not None and (now < self._last[0] or restarts != self._last[1]):
            for entries in self._entries.values():
                restart(entries, now)
        self._last = [now, restarts]

    def _advance(
        self, rule: Rule, scene: MonitoredBodies, answers: Measures, now: int
    ) -> tuple[Measures, list[AlertChange]]:
        """Advance one rule. Return its measures and its changes, by pair."""
        entries = self._entries[rule.name]
        i, j = (scene.roster.find_slots(ids.astype(np.uint32)) for ids in ids_of_keys(entries["key"]))
        is_removed = (i < 0) | (j < 0)
        removed, entries = entries.compress(is_removed), entries.compress(~is_removed)
        is_unknown = _is_stale(scene, i[~is_removed]) | _is_stale(scene, j[~is_removed])
        raised = entries["key"][entries["level"] > 0]
        found, level = evaluate_rule(self.rules, rule, self._classes, scene, answers, raised)
        uncertain = np.union1d(entries["key"][is_unknown], found.keys[found.uncertain])
        conditions = Conditions(found.keys, level, uncertain)
        after, before = advance_entries(entries, conditions, now, Delays(rule.raise_after, rule.clear_after))
        self._entries[rule.name] = lasting(after)
        changes = _ended(removed)
        for k in np.flatnonzero(after["level"] != before).tolist():
            key, new, since = int(after["key"][k]), int(after["level"][k]), int(after["since"][k])
            cause = AlertCause.UNRESOLVED if np.isin(after["key"][k], uncertain) else AlertCause.CONDITIONS
            classes = self._classes.of_pair(rule.between, scene.roster, key)
            changes.append(AlertChange(key, new, int(before[k]), since, cause, classes))
        return found, sorted(changes)

    def _messages(
        self, head: Head, rule: str, of: tuple[Rule, Measures] | None, changes: list[AlertChange]
    ) -> list[CollisionAlert]:
        made = []
        for change in changes:
            self.number += 1
            each = message(head, self.number, rule, change, of)
            pair = rule, each.id_a, each.id_b
            self._raised.pop(pair, None)
            if change.level:
                self._raised[pair] = each
            made.append(each)
        return made

    # ------------------------------------------------------------------ snapshots

    def save(self, snapshot: Snapshot) -> Facts:
        """Copy what later alerts depend on into the snapshot's arrays and into the facts that are returned."""
        kept = {**self._gone, **self._entries}
        for k, entries in enumerate(kept.values()):
            snapshot.arrays[f"{_ARRAY}.{k}"] = entries.copy()
        return {
            "rules": self.rules.text,
            "names": list(kept),
            "number": self.number,
            "last": self._last,
        }

    @classmethod
    def restored(cls, snapshot: Snapshot, facts: Any) -> Alerts:
        """Restore what `save` wrote. Raises InputError, KeyError, TypeError or ValueError for other content."""
        alerts = cls(Rules.parse(str(facts["rules"])))
        alerts.are_used = True
        alerts.number, alerts._last = int(facts["number"]), facts["last"]
        for k, name in enumerate(facts["names"]):
            entries = snapshot.array(f"{_ARRAY}.{k}", _none())
            (alerts._entries if name in alerts._entries else alerts._gone)[name] = entries
        return alerts


def _none() -> Entries:
    return np.zeros(0, ENTRY)


def _ended(entries: Entries) -> list[AlertChange]:
    """Return the end of each raised alert among the entries."""
    raised = entries.compress(entries["level"] > 0)
    return [AlertChange(int(e["key"]), 0, int(e["level"]), int(e["since"]), AlertCause.REMOVED) for e in raised]


def _is_stale(scene: MonitoredBodies, slots: Slots) -> NDArray[np.bool_]:
    return np.asarray(scene.stale[slots])
