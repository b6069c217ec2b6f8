"""What the diagnostics report: the state of the node, its inputs, its steps and its recording.

OK: nothing to do. WARN: the published answers are right, and something needs attention. ERROR: do not rely on the
answers; they may miss a collision, or they are missing though they should be there. docs/safety.md has the table.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import Final

from collision_monitor.alerts.rules_in_force import RuleInForce
from collision_monitor.codec import MonitorStatus
from collision_monitor.errors import Refusal
from collision_monitor.ros.durations import spoken
from collision_monitor.ros.health.line_report import DiagnosticLevel, LineReport
from collision_monitor.session import Recording

HISTORY: Final = 10
"""Reports over which counters are compared: a single refusal stays visible for about 10 s."""

NAMED: Final = 5
"""Things of the sources file that a report names; it counts the others."""

UNMONITORED: Final = (Refusal.UNKNOWN_ID, Refusal.SHAPE)
"""Refusals that mean an object which no answer covers and no other report mentions. An object whose states are refused
for another reason is unseen or becomes stale."""


@dataclass(frozen=True)
class Report:
    """One DiagnosticStatus without its node."""

    task: str
    level: DiagnosticLevel
    text: str
    values: dict[str, str]


@dataclass(frozen=True)
class NodeFacts:
    """What the reports rest on.

    topic: of the states. silence: s since newer states arrived, by the steady clock; None: none arrived yet.
    stale, unseen: the names of such objects. deferred, unresolved: most pairs in one step since the last report.
    longest, longest_step: duration (s) and number of the longest step since the node was configured.
    outdated: messages that were left out because newer states waited. is_reduced: the effort of the steps is reduced.
    other_nodes: nodes of the same name. sources: the lines of the sources file; None: there is no file. unmonitored:
    what the file asks for and is not monitored, in words. rules: those in force.
    """

    status: MonitorStatus
    topic: str
    silence: float | None
    stale_after: float
    stale: str
    unseen: str
    deferred: int
    unresolved: int
    outdated: int
    is_reduced: bool
    other_nodes: int
    longest: float
    longest_step: int
    sources: tuple[LineReport, ...] | None = None
    unmonitored: tuple[str, ...] = ()
    rules: tuple[RuleInForce, ...] = ()


@dataclass
class LastReports:
    """The statuses, the refusals of each source and the outdated messages at the last reports of one configuration."""

    _statuses: deque[MonitorStatus] = field(default_factory=lambda: deque(maxlen=HISTORY))
    _refused: deque[dict[str, int]] = field(default_factory=lambda: deque(maxlen=HISTORY))
    _outdated: deque[int] = field(default_factory=lambda: deque(maxlen=HISTORY))

    def increase(self, status: MonitorStatus, counters: Iterable[str]) -> dict[str, int]:
        """Return by how much counters of the status grew since the oldest report; the ones that did not are left out.

        Before the first report they were 0.
        """
        first = self._statuses[0] if len(self._statuses) == HISTORY else MonitorStatus()
        grown = {name: getattr(status, name) - getattr(first, name) for name in counters}
        return {name: count for name, count in grown.items() if count}

    def refused(self, line: LineReport) -> int:
        """Return the number of messages of a source that were refused since the oldest report."""
        first = self._refused[0] if len(self._refused) == HISTORY else {}
        return line.refused - first.get(line.name, 0)

    def outdated(self, facts: NodeFacts) -> int:
        """Return the number of messages that were left out since the oldest report."""
        return facts.outdated - (self._outdated[0] if len(self._outdated) == HISTORY else 0)

    def add(self, facts: NodeFacts) -> None:
        """Remember the counters of this report."""
        self._statuses.append(facts.status)
        self._outdated.append(facts.outdated)
        self._refused.append({line.name: line.refused for line in facts.sources or ()})


class _Findings:
    """Collects what is wrong; the report has the highest level, and the texts with the worst first."""

    def __init__(self) -> None:
        self._found: list[tuple[DiagnosticLevel, str]] = []

    def add(self, level: DiagnosticLevel, text: str) -> None:
        self._found.append((level, text))

    def report(self, task: str, otherwise: str, values: dict[str, object]) -> Report:
        found = sorted(self._found, key=lambda each: -each[0])
        text = "; ".join(text for _, text in found) or otherwise
        return Report(task, max((level for level, _ in found), default=DiagnosticLevel.OK), text, _texts(values))


def reports(state: str, failure: str, facts: NodeFacts | None, history: LastReports) -> list[Report]:
    """Return the reports of the node. facts: None if it is not configured. Adds the status to the history."""
    if facts is None:
        absent = [
            Report(task, DiagnosticLevel.STALE, f"none: the node is {state}", {})
            for task in ("inputs", "steps", "recording")
        ]
        return [_state(state, failure, 0), *absent]
    found = [
        _state(state, failure, facts.other_nodes),
        _inputs(facts, history),
        _steps(facts, history),
        _recording(facts.status, history),
    ]
    if facts.sources is not None:
        found.append(_sources(facts.sources, facts.unmonitored, history))
    if facts.rules:
        found.append(_rules(facts.rules))
    history.add(facts)
    return found


def _state(state: str, failure: str, other_nodes: int) -> Report:
    findings = _Findings()
    if failure:
        findings.add(DiagnosticLevel.ERROR, failure)
    if other_nodes:
        findings.add(DiagnosticLevel.ERROR, "another node of this name publishes on the same topics")
    if state != "active":
        findings.add(DiagnosticLevel.WARN, f"{state}: no answers are published")
    return findings.report("state", "active", {"state": state, "nodes of the same name": other_nodes})


def _inputs(facts: NodeFacts, history: LastReports) -> Report:
    status, findings = facts.status, _Findings()
    moving = status.objects - status.objects_static
    if facts.silence is not None and facts.silence >= facts.stale_after and moving:
        findings.add(DiagnosticLevel.ERROR, f"silent: no newer states on {facts.topic} for {spoken(facts.silence)}")
    elif facts.stale:
        findings.add(DiagnosticLevel.ERROR, f"stale: no usable new state of object {facts.stale}")
    if status.objects_unseen:
        findings.add(DiagnosticLevel.ERROR, f"unseen: no state yet of object {facts.unseen}")
    refused = history.increase(status, [f"refused_{reason.value}" for reason in Refusal])
    if refused:
        is_unmonitored = any(f"refused_{reason.value}" in refused for reason in UNMONITORED)
        counts = ", ".join(f"{count} {name.removeprefix('refused_')}" for name, count in refused.items())
        level = DiagnosticLevel.ERROR if is_unmonitored else DiagnosticLevel.WARN
        findings.add(level, f"refused lately: {counts} (last: {status.last_refusal})")
    for count in history.increase(status, ["messages_lost"]).values():
        findings.add(DiagnosticLevel.WARN, f"lost lately: {count} messages on {facts.topic}")
    if not status.objects:
        findings.add(DiagnosticLevel.WARN, "no object is described")
    names = ("objects", "objects_static", "objects_unseen", "objects_stale", "messages_lost")
    counters = (*names, *(f"refused_{reason.value}" for reason in Refusal))
    values = {"silence [s]": facts.silence, **{name: getattr(status, name) for name in counters}}
    return findings.report("inputs", f"{status.objects} objects, all up to date", values)


def _steps(facts: NodeFacts, history: LastReports) -> Report:
    status, findings = facts.status, _Findings()
    if status.latency > facts.stale_after:
        findings.add(
            DiagnosticLevel.ERROR, f"late: the answers are {status.latency:.2f} s behind the stamps of their states"
        )
    elif math.isnan(status.latency) and status.step:
        findings.add(
            DiagnosticLevel.WARN, "the latency is unknown, because the stamps of the states are from another clock"
        )
    if facts.unresolved:
        findings.add(
            DiagnosticLevel.WARN, f"unresolved: up to {facts.unresolved} pairs in a step; treat them as colliding"
        )
    if facts.deferred:
        findings.add(DiagnosticLevel.WARN, f"deferred: the budget ran out, up to {facts.deferred} pairs in a step")
    if count := history.outdated(facts):
        findings.add(DiagnosticLevel.WARN, f"slower than the states: {count} outdated messages left out lately")
    if facts.is_reduced:
        findings.add(DiagnosticLevel.WARN, f"reduced effort: profile {status.profile}")
    if status.rate > 1.0 and status.step_duration_p99 * status.rate > 1.0:
        findings.add(
            DiagnosticLevel.WARN,
            f"slow: 1 % of the steps take {status.step_duration_p99 * 1e3:.1f} ms or more at {status.rate:.0f} Hz",
        )
    values = {
        "step": status.step,
        "rate [Hz]": status.rate,
        "latency [s]": status.latency,
        "step_duration_p99 [s]": status.step_duration_p99,
        "longest step [s]": facts.longest,
        "longest step number": facts.longest_step,
        "deferred": facts.deferred,
        "unresolved": facts.unresolved,
        "outdated": facts.outdated,
        "contacts": status.contacts,
        "predictions": status.predictions,
        "profile": status.profile,
        "version": status.version,
    }
    return findings.report("steps", f"{status.rate:.0f} steps/s" if status.step else "no step yet", values)


def _recording(status: MonitorStatus, history: LastReports) -> Report:
    findings = _Findings()
    if status.recording == Recording.FAILED:
        findings.add(DiagnosticLevel.WARN, f"the recording failed, the monitoring goes on: {status.recording_error}")
    else:
        for count in history.increase(status, ["recording_dropped"]).values():
            findings.add(DiagnosticLevel.WARN, f"the disk is too slow: {count} messages dropped lately")
    is_on = status.recording == Recording.ON
    names = ("recording_path", "recorded_messages", "recorded_bytes", "recording_dropped")
    values = {name: getattr(status, name) for name in names}
    return findings.report("recording", f"recording to {status.recording_path}" if is_on else "not recording", values)


def _sources(lines: tuple[LineReport, ...], unmonitored: tuple[str, ...], history: LastReports) -> Report:
    findings = _Findings()
    for text in unmonitored[:NAMED]:
        findings.add(DiagnosticLevel.ERROR, f"not monitored: {text}")
    if len(unmonitored) > NAMED:
        findings.add(DiagnosticLevel.ERROR, f"not monitored: {len(unmonitored) - NAMED} more, see ~/sources")
    for line in lines:
        if line.level == DiagnosticLevel.ERROR:
            findings.add(DiagnosticLevel.ERROR, f"unusable: {line.text}")
        elif count := history.refused(line):
            findings.add(DiagnosticLevel.WARN, f"refused lately: {count} of {line.name} (last: {line.last_refusal})")
        elif line.level == DiagnosticLevel.WARN and not line.refused:
            findings.add(DiagnosticLevel.WARN, line.text)
    refused = sum({line.name: line.refused for line in lines}.values())  # a robot has several lines
    values: dict[str, object] = {"messages": sum(line.messages for line in lines), "refused": refused}
    if unmonitored:
        values["not monitored"] = len(unmonitored)
    return findings.report("sources", f"{len(lines)} topics", values)


def _rules(rules: tuple[RuleInForce, ...]) -> Report:
    findings = _Findings()
    for rule in rules:
        if not rule.is_whole:
            findings.add(DiagnosticLevel.WARN, f"rule {rule.name!r} {rule.summary}")
    values: dict[str, object] = {rule.name: rule.summary for rule in rules}
    return findings.report("rules", f"{len(rules)} in force, each covers somebody", values)


def _texts(values: dict[str, object]) -> dict[str, str]:
    return {key: f"{value:.6g}" if isinstance(value, float) else str(value) for key, value in values.items()}
