"""Assessment of a session in sentences: what happened, and why more may have happened.

A session is called clear only if all of it is known.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from collision_monitor.errors import Refusal
from collision_monitor.report.facts import ReportFacts
from collision_monitor.session.history.alerts import AlertOutcome, stated_error
from collision_monitor.session.history.history import History

NAMED: Final = 3
"""Largest number of objects, gaps or problems that are listed. The rest is only counted."""


@dataclass(frozen=True)
class Assessment:
    """Verdict on a session.

    kind: `collisions`, `clear`, or `unknown` if there is no known collision but not everything is known. answer: the
    headline. findings: sentences about what happened. doubts: reasons why more may have happened.
    """

    kind: str
    answer: str
    findings: list[str]
    doubts: list[str]


def assess(history: History, facts: ReportFacts) -> Assessment:
    """Assess a session."""
    doubts = _doubts(history, facts)
    count = len(facts.collisions)
    if count:
        kind, answer = "collisions", ("At least " if doubts else "") + counted(count, "collision")
    elif doubts:
        kind, answer = "unknown", "No known collision, but not everything is known"
    else:
        kind, answer = "clear", "No collisions"
    return Assessment(kind, answer, _findings(facts), doubts)


def counted(count: int, what: str) -> str:
    """Return a number with its noun, in the plural if needed."""
    return f"{count} {what}{'' if count == 1 else 's'}"


OTHERWISE: Final = (
    "the objects did not go on as their states said: straight on, also of an object that turns, unless its state has "
    "BODY_TWIST or it has a plan"
)
"""Why a prediction can be wrong; a robot that keeps its speed and its turn has changed nothing."""


def _were(count: int) -> str:
    return f"{count} {'was' if count == 1 else 'were'}"


def _findings(facts: ReportFacts) -> list[str]:
    lines = []
    leads = np.array([each.warned for each in facts.collisions if each.warned > 0.0])
    if len(leads):
        lines.append(
            f"{_were(len(leads))} predicted: at least {leads.min():.2f} s ahead, with a median of "
            f"{np.median(leads):.2f} s"
        )
    wrong = [each for each in facts.answered if stated_error(facts.answered[each], each, facts.period)[0] != 0.0]
    if wrong:
        lines.append(
            f"the first prediction of {len(wrong)} stated an interval without the contact, because {OTHERWISE}; later "
            "predictions corrected it"
        )
    if facts.surprises:
        lines.append(f"{len(facts.surprises)} had no prediction right before the contact")
    there = len(facts.collisions) - len(leads) - len(facts.surprises)
    if there:
        lines.append(f"{_were(there)} in contact from the first step on")
    judged = facts.judged
    if judged.false_alarms:
        lines.append(
            f"{judged.false_alarms} of {judged.alarms} alarms (pairs × steps) were false, without a contact within the "
            f"horizon: {OTHERWISE}, or they passed each other within the tolerance"
        )
    due = sum(each[-1].certain and each[-1].outcome is AlertOutcome.OPEN for each in facts.alerts.values())
    if due:
        lines.append(f"{counted(due, 'pair')} still predicted to touch when the session ended")
    if not facts.collisions and not facts.alerts:
        lines.append("no collision was predicted either")
    return lines


def _doubts(history: History, facts: ReportFacts) -> list[str]:
    lines = _some(history.problems, "problems with the recording")
    if not len(history.times):
        return [*lines, "no step was answered; --replay computes the answers now"]
    if not history.objects:
        lines.append("the session describes no object")
    seen = set(history.states["id"].tolist())
    unseen = [each.name for i, each in sorted(history.objects.items()) if not each.static and i not in seen]
    if unseen:
        lines.append(f"no state of {_names(unseen)} was ever received")
    lasting = [each.text for each in history.unmonitored if each.is_lasting]
    lines += _some([f"not monitored: {text}" for text in lasting], "things that were not monitored")
    if history.restarts:
        often = counted(history.restarts, "time")
        lines.append(f"the clock was set back ({often}): times on this page continue as if it had stood still")
    lines += _some([f"no step from {a:.2f} s to {b:.2f} s" for a, b in facts.gaps], "gaps between the steps")
    if facts.possible:
        lines.append(f"{counted(len(facts.possible), 'further contact')} could not be excluded (UNRESOLVED)")
    stale = len(np.unique(history.prediction_step[history.predictions["stale"] != 0]))
    if stale:
        lines.append(f"in {counted(stale, 'step')} predictions were based on states that were too old")
    return lines + _counted(history)


def _counted(history: History) -> list[str]:
    """Return a sentence for each kind of loss that the last status counts."""
    status = history.status
    if status is None:
        return ["the session holds no status message, so refused and lost messages are unknown"]
    lines = []
    refused = {reason.value: int(getattr(status, f"refused_{reason.value}")) for reason in Refusal}
    if any(refused.values()):
        reasons = ", ".join(f"{name.replace('_', ' ')} {count}" for name, count in refused.items() if count)
        count = counted(sum(refused.values()), "refusal")
        lines.append(f"{count} of messages, states or shapes ({reasons}); the last: {status.last_refusal}")
    if status.messages_lost:
        lines.append(f"{counted(status.messages_lost, 'message')} with states did not reach the monitor")
    if status.recording_dropped:
        lines.append(f"{counted(status.recording_dropped, 'message')} could not be recorded")
    if status.recording_error:
        lines.append(f"the recorder failed: {status.recording_error}")
    return lines


def _some(sentences: list[str], what: str) -> list[str]:
    more = len(sentences) - NAMED
    return [*sentences[:NAMED], f"and {more} more {what}"] if more > 0 else sentences


def _names(names: list[str]) -> str:
    more = len(names) - NAMED
    return ", ".join(names[:NAMED]) + (f" and {more} more" if more > 0 else "")
