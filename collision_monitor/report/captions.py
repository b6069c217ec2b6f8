"""The sentences over the pictures: what each shows, and what it leaves out."""

from __future__ import annotations

from collision_monitor.report.assessment import counted
from collision_monitor.report.facts import Facts
from collision_monitor.report.figures import CURVES, PAIRS, drawn_collisions, largest_error
from collision_monitor.report.from_above import AROUND, EVENTS
from collision_monitor.session.history.history import History


def captions(history: History, facts: Facts) -> dict[str, str]:
    """The caption of each picture, by the names that `figures` gives."""
    return {
        "timeline": _timeline(facts),
        "predicted": _predicted(facts),
        "distances": _distances(),
        "events": _events(facts),
        "steps": _steps(history),
    }


def _timeline(facts: Facts) -> str:
    left = len(facts.risky) - PAIRS
    out = f" The {PAIRS} riskiest pairs; {counted(left, 'more pair')} left out." if left > 0 else ""
    return f"When pairs touched, and when they were predicted to.{out}"


def _predicted(facts: Facts) -> str:
    left = len(facts.answered) - len(drawn_collisions(facts))
    worst = largest_error(facts)
    held = f"at worst the interval was off by {worst:.2g} s" if worst > 0.0005 else "here every interval was right"
    return (
        "For each collision that was predicted: how far off the stated time was, from the first prediction to the "
        "contact. The band is the stated interval; below the grey it was too early, above too late. "
        f"A prediction says what happens if both go on as they move: {held}."
        + (f" The {CURVES} that were furthest off; {left} more left out." if left else "")
    )


def _distances() -> str:
    return (
        "Distance of the shapes, computed from the recorded states, and the time to collision that was predicted. "
        "Gaps: no state was known, or the object was moved."
    )


def _events(facts: Facts) -> str:
    left = len(facts.collisions) - EVENTS
    out = f" Unpredicted and deepest first; {left} more left out." if left > 0 else ""
    return (
        f"Tracks from {AROUND:g} s before to {AROUND:g} s after the contact began, in m from the point of contact. "
        f"Filled: then; dotted: {AROUND / 2:g} s before.{out}"
    )


def _steps(history: History) -> str:
    if history.replayed:
        return f"How long the steps of this replay took ({len(history.durations)} steps)."
    return f"How long the monitor took, as its status said ({counted(len(history.durations), 'status message')})."
