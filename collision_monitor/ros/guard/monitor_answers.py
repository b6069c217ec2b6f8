"""The answers of the monitor as a guard reads them, and why it cannot rely on them: late, not covering, of two.

Without ROS, so that each reason is tested by itself.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Final, NamedTuple

import numpy as np

from collision_monitor.alerts.name_patterns import may_name
from collision_monitor.alerts.rules import ANY
from collision_monitor.codec import AlertLevel, CollisionAlert, CollisionAlertArray, RuleCoverage
from collision_monitor.monitor.state.timeline import NANOSECOND
from collision_monitor.ros.durations import spoken
from collision_monitor.ros.guard.guard_limits import GuardLimits
from collision_monitor.ros.guard.guarded_objects import GuardedObjects
from collision_monitor.ros.guard.speed_limit import Braking, NearPair

HEARD: Final = 1.2
"""s for which a monitor counts as there after its last answer; it answers twice a second at least."""

NAMED: Final = 5
"""Objects that a reason names."""


class Fault(NamedTuple):
    """Why the guard cannot rely on what it knows. kind: the same while only numbers change; text: for people."""

    kind: str
    text: str


class ClockReading(NamedTuple):
    """The time by the clock of the stamps (ns), and the steady one (s)."""

    stamp_ns: int
    steady: float


class MonitorAnswers:
    """The last answer of the monitor, and when which monitors were heard. monitor: name of its node."""

    def __init__(self, monitor: str, limits: GuardLimits) -> None:
        self._monitor, self.limits = monitor, limits
        self.array: CollisionAlertArray | None = None
        self._heard: dict[int, float] = {}  # by number of the monitor: steady time of its last answer
        self._step: int | None = None
        self._stepped = 0.0  # steady time of the last new step

    def take(self, array: CollisionAlertArray, now: float) -> None:
        """Take over an answer that arrived now (steady s)."""
        if self.array is None or (array.monitor, array.step) != (self.array.monitor, self.array.step):
            self._stepped = now
        self.array = array
        self._heard[array.monitor] = now
        self._heard = {number: at for number, at in self._heard.items() if now - at <= HEARD}

    # -- faults

    def fault(self, robot: GuardedObjects, now: ClockReading) -> Fault | None:
        """Return the first reason not to rely on the answers; None if there is none."""
        array = self.array
        if array is None:
            return Fault("silent", f"no status of {self._monitor}: does the monitor run?")
        faults = (
            self._two(now),
            self._late(array, now),
            self._unnamed(robot),
            self.lost(robot, now),
            self.uncovered(array, robot),
            self.missing(array, robot),
        )
        return next((each for each in faults if each is not None), None)

    def _late(self, array: CollisionAlertArray, now: ClockReading) -> Fault | None:
        if not array.step:
            return Fault("no step", f"no step of {self._monitor} yet: no states reach it")
        since = now.steady - self._stepped
        if since > self.limits.max_age:
            return Fault("no step", f"no step of {self._monitor} for {spoken(since)}")
        return self._age("answer", f"the answers of {self._monitor} are", array.stamp_ns, now)

    def _age(self, kind: str, words: str, stamp_ns: int, now: ClockReading) -> Fault | None:
        age = (now.stamp_ns - stamp_ns) * NANOSECOND
        if age > self.limits.max_age:
            return Fault(f"old {kind}", f"{words} {spoken(age)} old")
        if age < -self.limits.ahead:
            return Fault(f"early {kind}", f"{words} {spoken(-age)} ahead of the guard's clock: another clock")
        return None

    def _two(self, now: ClockReading) -> Fault | None:
        heard = sum(now.steady - at <= HEARD for at in self._heard.values())
        if heard < 2:
            return None
        return Fault("two monitors", f"{heard} monitors answer as {self._monitor}, or it has just restarted")

    def _unnamed(self, robot: GuardedObjects) -> Fault | None:
        missing = robot.without_objects()
        if not missing:
            return None
        return Fault(f"no object {missing}", f"no object is named {', '.join(map(repr, missing[:NAMED]))}")

    def lost(self, robot: GuardedObjects, now: ClockReading) -> Fault | None:
        """Return the first object of the robot whose state is missing or old; None if there is none."""
        found = (self.state_fault(each, name, robot, now) for each, name in robot.names.items())
        return next((each for each in found if each is not None), None)

    def state_fault(self, object_id: int, name: str, robot: GuardedObjects, now: ClockReading) -> Fault | None:
        """Return why the state of an object of the robot cannot be relied on; None if it can."""
        state = robot.states.get(object_id)
        if state is None:
            return Fault(f"no state {name}", f"no state of {name!r} so far")
        if now.steady - state.arrived > self.limits.max_age:
            return Fault(f"no state {name}", f"no state of {name!r} for {spoken(now.steady - state.arrived)}")
        return self._age(f"state {name}", f"the states of {name!r} are", state.stamp_ns, now)

    def uncovered(self, array: CollisionAlertArray, robot: GuardedObjects) -> Fault | None:
        """Return the objects of the robot that no rule covers; None if there are none."""
        covered = {int(each) for rule in array.coverage for each in rule.ids}
        bare = [name for object_id, name in robot.names.items() if object_id not in covered]
        if not bare:
            return None
        if not array.rule_names:
            return Fault("no rules", f"no alerts of {self._monitor}: has it rules? None is in force")
        rules = ", ".join(map(repr, array.rule_names[:NAMED]))
        names = ", ".join(map(repr, bare[:NAMED])) + (f" and {len(bare) - NAMED} more" if len(bare) > NAMED else "")
        return Fault(f"uncovered {bare}", f"no rule in force covers {names} now; the rules are {rules}")

    def missing(self, array: CollisionAlertArray, robot: GuardedObjects) -> Fault | None:
        """Return the first object that is not monitored, and concerns the robot; None if there is none."""
        own = {k for k, rule in enumerate(array.coverage) if np.isin(rule.ids, list(robot.names)).any()}
        for each in array.unmonitored:
            age = (array.stamp_ns - each.since_ns) * NANOSECOND
            if each.is_silent:
                is_due = each.name not in robot.names.values() and age > self.limits.obstacle
                if is_due and own.intersection(each.coverage):
                    return Fault(f"silent {each.name}", f"{each.name!r}: {each.reason} for {spoken(age)}")
            elif not each.name or any(may_name(pattern, each.name) for pattern in robot.patterns):
                return Fault(f"missing {each.name}", f"not monitored, and part of the robot: {each.reason}")
            elif own.intersection(each.coverage):
                return Fault(f"missing {each.name}", f"not monitored, though the rules name it: {each.reason}")
        return None

    # -- what a rule sees

    def doubts(self, robot: GuardedObjects) -> list[str]:
        """Return what is not wrong and worth a warning: objects whose rules do not see what stands near."""
        assert self.array is not None
        found = []
        for object_id, name in robot.names.items():
            rules = self._covering(object_id)
            if rules and all(rule.unfit for rule in rules):
                found.append(f"rule {rules[0].rule!r} of {name!r}: {rules[0].unfit}; the robot may start toward it")
        return found

    def fastest(self, robot: GuardedObjects, braking: Braking) -> float:
        """Return the largest speed (m/s) from which the robot stops within what the rules of each object see ahead."""
        speeds = [_fastest(self._covering(object_id), braking) for object_id in robot.names]
        return min(speeds, default=0.0)

    def _covering(self, object_id: int) -> list[RuleCoverage]:
        assert self.array is not None
        return [rule for rule in self.array.coverage if object_id in rule.ids]

    def near(self, robot: GuardedObjects) -> Iterator[NearPair]:
        """Yield what concerns an object of the robot and one that is not; both of the robot move together."""
        assert self.array is not None
        for alert in self.array.alerts:
            if (alert.id_a in robot.names) != (alert.id_b in robot.names):
                yield _of_alert(alert, alert.id_a in robot.names)
        held = self.array.held_back
        mine = np.isin(held["id_a"], list(robot.names)) != np.isin(held["id_b"], list(robot.names))
        for row in held[mine]:
            yield _of_row(row, self.array.rule_names, robot)


def _fastest(rules: list[RuleCoverage], braking: Braking) -> float:
    """Of rules against every object the one that sees farthest counts; else each has objects of its own."""
    against_all = [braking.speed_ahead(rule.reach, rule.ahead) for rule in rules if rule.against == ANY]
    if against_all:
        return max(against_all)
    return min((braking.speed_ahead(rule.reach, rule.ahead) for rule in rules), default=0.0)


def _of_alert(alert: CollisionAlert, is_a: bool) -> NearPair:
    ends = (alert.id_a, alert.name_b, alert.point_a, alert.point_b)
    part, other, at, to = ends if is_a else (alert.id_b, alert.name_a, alert.point_b, alert.point_a)
    measures = alert.distance, alert.closing_speed, alert.time_to_collision
    return NearPair(part, other, alert.rule, alert.level, *measures, at, to, alert.text)


def _of_row(row: np.void, rules: tuple[str, ...], robot: GuardedObjects) -> NearPair:
    is_a = int(row["id_a"]) in robot.names
    own, there = ("a", "b") if is_a else ("b", "a")
    part, other = int(row[f"id_{own}"]), robot.name(int(row[f"id_{there}"]))
    measures = float(row["distance"]), float(row["closing_speed"]), float(row["time_to_collision"])
    number, level = int(row["rule"]), int(row["level"])
    rule = rules[number] if number < len(rules) else ""
    text = f"{robot.name(part)} and {other}: {AlertLevel(level).name.lower()} by rule {rule!r}, without an alert yet"
    at, to = tuple(row[f"point_{own}"].tolist()), tuple(row[f"point_{there}"].tolist())
    return NearPair(part, other, rule, level, *measures, at, to, text)
