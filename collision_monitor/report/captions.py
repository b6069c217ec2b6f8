"""Captions of the figures: what each figure shows and what it omits."""

from __future__ import annotations

from collision_monitor.report.alert_bars import alert_caption
from collision_monitor.report.assessment import counted
from collision_monitor.report.facts import ReportFacts
from collision_monitor.report.figures import CURVES, NEAR, PAIRS, drawn_collisions, largest_error
from collision_monitor.report.from_above import AROUND, EVENTS
from collision_monitor.report.plans_from_above import plan_caption
from collision_monitor.session.history.history import History


def captions(history: History, facts: ReportFacts) -> dict[str, str]:
    """Return the caption of each figure, by the names that `figures` uses."""
    return {
        "timeline": _timeline(facts),
        "alerts": alert_caption(history),
        "predicted": _predicted(facts),
        "distances": _distances(),
        "events": _events(facts),
        "plans": plan_caption(history),
        "steps": _steps(history),
    }


def _timeline(facts: ReportFacts) -> str:
    left = len(facts.risky) - PAIRS
    out = f" Only the {PAIRS} riskiest pairs; {counted(left, 'more pair')} left out." if left > 0 else ""
    return f"When each pair touched, and when it was predicted to touch.{out}"


def _predicted(facts: ReportFacts) -> str:
    left = len(facts.answered) - len(drawn_collisions(facts))
    worst = largest_error(facts)
    held = f"The largest error of an interval was {worst:.2g} s" if worst > 0.0005 else "Here every interval was right"
    return (
        "Error of the stated time of contact for each predicted collision, from the first prediction to the contact. "
        "The coloured band is the stated interval. Below the grey band it was too early, above it too late; "
        "beyond five steps the scale is logarithmic. "
        f"A prediction assumes that both objects keep their motion. {held}."
        + (f" Only the {CURVES} collisions with the largest errors; {left} more left out." if left else "")
    )


def _distances() -> str:
    return (
        "Distance of the shapes, computed from the recorded states, to scale within "
        f"{NEAR:g} m and logarithmic beyond, and the predicted time to collision. "
        "A curve has a gap where a state is missing or an object jumped."
    )


def _events(facts: ReportFacts) -> str:
    left = len(facts.collisions) - EVENTS
    out = f" Only the unpredicted, then the deepest collisions; {left} more left out." if left > 0 else ""
    return (
        f"Tracks from {AROUND:g} s before to {AROUND:g} s after the contact began, in m from the point of contact. "
        f"Filled outlines: when the contact began; dotted outlines: {AROUND / 2:g} s before.{out}"
    )


def _steps(history: History) -> str:
    if history.replayed:
        return f"Durations of the {len(history.durations)} steps of this replay."
    return f"Step durations that the monitor reported ({counted(len(history.durations), 'status message')})."
