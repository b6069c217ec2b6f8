"""A slow and simple monitor that recomputes every prediction at every step. The event list is tested against it."""

from __future__ import annotations

import numpy as np

from collision_monitor.accuracy.playback import by_pair
from collision_monitor.monitor.monitor import Monitor
from collision_monitor.monitor.result import StepResult
from collision_monitor.monitor.step_context import StepContext
from collision_monitor.monitor.tracking import Slots, Tracking
from collision_monitor.monitor.uncertain_predictions import UncertainPredictions
from collision_monitor.records import PredictionStatus
from collision_monitor.settings.profile import Profile


class ReferenceMonitor(Monitor):
    """A Monitor that reuses no earlier prediction and allows no deviation from the stated motions."""

    def __init__(self, profile: str | Profile = "balanced") -> None:
        super().__init__(profile)
        self.profile = self.profile.replace(
            name="reference",
            position_tolerance=0.0,
            orientation_tolerance=0.0,
            velocity_tolerance=0.0,
            angular_velocity_tolerance=0.0,
        )
        self._tracking = _RestartAll()


class _RestartAll(Tracking):
    """Restarts the motion of every body at every step."""

    def _moved(self, step: StepContext, uncertain: UncertainPredictions) -> tuple[Slots, Slots]:
        roster = step.roster
        bodies, top = roster.bodies, roster.top
        moved = np.flatnonzero(bodies.used[:top] & bodies.seen[:top] & ~bodies.static[:top]).astype(np.int32)
        return moved, np.zeros(0, np.int32)


def disagreements(mine: StepResult, reference: StepResult, horizon: float) -> list[str]:
    """Return the contradictions of an answer and the recomputation from the same states, one sentence each.

    Both must report the same contacts. If a collision is certain in one of them, the other must report it too, and the
    two intervals of its time must overlap. Near the horizon (s) one of them may not report it yet.
    """
    found = []
    touching = [by_pair(result.contacts).keys() for result in (mine, reference)]
    found += [f"{pair} touches in one answer only" for pair in sorted(touching[0] ^ touching[1])]
    stated, true = by_pair(mine.predictions), by_pair(reference.predictions)
    found += [f"{pair} touches and is predicted" for pair in sorted(stated.keys() & touching[0])]
    for pair, truth in true.items():
        if truth["status"] != PredictionStatus.HIT or truth["upper"] >= horizon:
            continue
        answer = stated.get(pair)
        if answer is None:
            found.append(f"{pair} is missed: it collides in {truth['lower']:.6g} s")
        elif answer["lower"] > truth["upper"] or answer["upper"] < truth["lower"]:
            times, actual = [(float(each["lower"]), float(each["upper"])) for each in (answer, truth)]
            found.append(f"{pair} is predicted in {times} s and collides in {actual} s")
    for pair, answer in stated.items():
        if answer["status"] == PredictionStatus.HIT and answer["upper"] < horizon and pair not in true:
            found.append(f"{pair} is certain to collide in {answer['lower']:.6g} s and never does")
    return found
