"""Numbers of a report, gathered from the history of a session before anything is drawn."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from collision_monitor.report.object_tracks import Tracks
from collision_monitor.session.history.alarms import Alarms, alarms_of
from collision_monitor.session.history.alerts import Alert, AlertOutcome, alert_before, alerts_of
from collision_monitor.session.history.history import CollisionEvent, Floats, History, Pair


@dataclass(frozen=True, eq=False)
class ReportFacts:
    """Numbers of a session.

    period: median time between steps (s). gaps: from, to (s), without an answered step. collisions: certain contacts.
    surprises: collisions without a prediction right before. possible: contacts that could not be excluded. alerts: by
    pair. nothing: certain alerts that ended without a contact. judged: counts of false and late alarms, as `tradeoff`
    and `compare` have them. risky: all pairs that touched or were predicted to touch, the riskiest first. answered: the
    alert of each predicted collision.
    """

    period: float
    gaps: list[tuple[float, float]]
    collisions: list[CollisionEvent]
    surprises: list[CollisionEvent]
    possible: list[CollisionEvent]
    alerts: dict[Pair, list[Alert]]
    nothing: list[Alert]
    judged: Alarms
    risky: list[Pair]
    answered: dict[CollisionEvent, Alert]
    tracks: Tracks


def gather(history: History) -> ReportFacts:
    """Gather the facts of a history."""
    period = history.period
    found = alerts_of(history)
    alerts: dict[Pair, list[Alert]] = {}
    for alert in found:
        alerts.setdefault(alert.pair, []).append(alert)
    certain = [each for each in history.collisions if each.certain]
    before = {each: alert_before(alerts.get(each.pair, []), each) for each in certain}
    return ReportFacts(
        period=period,
        gaps=_gaps(history.times, history.longest_step),
        collisions=certain,
        surprises=[each for each in certain if each.warned == 0.0],
        possible=[each for each in history.collisions if not each.certain],
        alerts=alerts,
        nothing=[alert for alert in found if alert.certain and alert.outcome is AlertOutcome.NOTHING],
        judged=alarms_of(history),
        risky=_riskiest(history, alerts),
        answered={collision: alert for collision, alert in before.items() if alert is not None},
        tracks=Tracks(history),
    )


def _gaps(times: Floats, longest: float) -> list[tuple[float, float]]:
    return [(float(times[k]), float(times[k + 1])) for k in np.flatnonzero(np.diff(times) > longest)]


def _riskiest(history: History, alerts: dict[Pair, list[Alert]]) -> list[Pair]:
    """Return the pairs of collisions, deepest first, then the pairs that were only predicted, soonest first."""
    depth: dict[Pair, float] = {}
    for each in history.collisions:
        depth[each.pair] = min(depth.get(each.pair, np.inf), each.deepest if each.certain else 0.0)
    soonest = {
        pair: (not any(a.certain for a in each), min(float(a.lower.min()) for a in each))
        for pair, each in alerts.items()
        if pair not in depth
    }
    return [
        *sorted(depth, key=lambda pair: (depth[pair], pair)),
        *sorted(soonest, key=lambda pair: (soonest[pair], pair)),
    ]
