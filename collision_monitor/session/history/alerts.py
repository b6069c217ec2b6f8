"""Alerts, which are unbroken runs of predictions of one pair, and their outcomes."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum

import numpy as np
from numpy.typing import NDArray

from collision_monitor.impact.impact_record import pair_keys
from collision_monitor.records import PredictionStatus
from collision_monitor.session.history.history import CollisionEvent, Floats, History, Pair


class AlertOutcome(Enum):
    """Outcome of an alert."""

    CONTACT = "the pair touched when it was due"
    NOTHING = "it ended without a contact"
    OPEN = "the session ends, or has a gap, before"


@dataclass(frozen=True, eq=False)
class Alert:
    """Predictions of one pair in consecutive steps.

    time (n,): s, when each was made. lower, upper (n,): s from then on, the predicted interval of the first contact;
    upper is infinite if no upper bound was predicted. certain: at least one was a HIT.
    """

    pair: Pair
    time: Floats
    lower: Floats
    upper: Floats
    certain: bool
    outcome: AlertOutcome

    @property
    def begin(self) -> float:
        """Time of the first prediction (s)."""
        return float(self.time[0])

    @property
    def first_stated(self) -> tuple[float, float]:
        """Interval of the contact in the first prediction: from, to (s)."""
        return float(self.time[0] + self.lower[0]), float(self.time[0] + self.upper[0])


def alerts_of(history: History) -> list[Alert]:
    """Return all alerts of a history, sorted by begin and pair."""
    period, longest = history.period, history.longest_step
    unseen = np.append(np.diff(history.times) > longest, True)  # (n,): a gap, or the end, follows the step
    rows, steps = history.predictions, history.prediction_step
    keys = pair_keys(rows["id_a"], rows["id_b"])
    order = np.lexsort((steps, keys))
    apart = (np.diff(steps[order]) != 1) | unseen[steps[order][:-1]]
    breaks = np.flatnonzero((np.diff(keys[order]) != 0) | apart) + 1
    begins: dict[Pair, list[float]] = {}
    for collision in history.collisions:
        begins.setdefault(collision.pair, []).append(collision.begin)
    found = []
    for run in np.split(order, breaks) if len(order) else ():
        pair = (int(rows["id_a"][run[0]]), int(rows["id_b"][run[0]]))
        time, lower, upper = history.times[steps[run]], rows["lower"][run], rows["upper"][run]
        due = float((time + np.where(np.isfinite(upper), upper, history.profile.horizon)).max()) + 2.0 * period
        touched = any(time[0] < begin <= due for begin in begins.get(pair, ()))
        last = unseen[steps[run[-1]]]
        found.append(
            Alert(
                pair=pair,
                time=time,
                lower=lower,
                upper=upper,
                certain=bool((rows["status"][run] == PredictionStatus.HIT).any()),
                outcome=AlertOutcome.CONTACT if touched else AlertOutcome.OPEN if last else AlertOutcome.NOTHING,
            )
        )
    return sorted(found, key=lambda alert: (alert.begin, alert.pair))


def alert_before(alerts: list[Alert], collision: CollisionEvent) -> Alert | None:
    """Return the pair's alert that lasted until the collision began; None if there is none."""
    if not collision.warned > 0.0:
        return None
    before = [alert for alert in alerts if alert.begin < collision.begin and alert.outcome is AlertOutcome.CONTACT]
    return before[-1] if before else None


def stated_error(alert: Alert, collision: CollisionEvent, period: float) -> NDArray[np.float64]:
    """Return how far each predicted interval is from the step in which the contact began, (n,) s; negative: too early.

    0 if they overlap, because the moment of the contact within that step is unknown.
    """
    low, high = alert.time + alert.lower, alert.time + alert.upper
    early = np.minimum(high - (collision.begin - period), 0.0)
    late = np.maximum(low - collision.begin, 0.0)
    return np.asarray(early + late, np.float64)
