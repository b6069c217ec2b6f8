"""A plan as a gate follows it: the planned motion of each object of the robot, and how fast it is run through."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from collision_monitor.motion.stated_motion import LINEAR
from collision_monitor.motion.trajectory import Trajectory

Floats = NDArray[np.float64]

MOVES: Final = 1e-6
"""m, and about rad: less is round-off of a body that stands."""

BRAKING_PARTS: Final = 8
"""Parts of a braking, within each of which the rate counts as constant. More: narrower tubes, and longer checks."""


@dataclass(frozen=True, eq=False)
class GatedPlan:
    """bodies: planned motion of each object of the robot by its id, over the time of the plan from 0 to `end` (s).

    reaches: radius (m) of each object about its origin. source: what its messages are made of again.
    """

    bodies: dict[int, Trajectory]
    end: float
    reaches: dict[int, float]
    source: Any = field(default=None, repr=False)

    def places(self, object_id: int, times: Floats) -> Floats:
        """Poses (T, 7) of an object at times of the plan (T,)."""
        return np.asarray(self.bodies[object_id].rows(np.clip(times, 0.0, self.end))[:, :LINEAR])

    def off(self, measured: dict[int, Floats], times: Floats) -> Floats:
        """How far (T,) the robot is off its plan at times (T,): the most of all points of its objects, m.

        measured: pose (7,) of each object.
        """
        worst = np.zeros(len(times))
        for object_id, pose in measured.items():
            there = self.places(object_id, times)
            moved = np.linalg.norm(there[:, :3] - pose[:3], axis=1)
            half = np.abs(there[:, 3:] @ pose[3:]).clip(0.0, 1.0)  # cosine of half the turn between both
            turned = 2.0 * np.sqrt(np.maximum(0.0, 1.0 - half * half)) * self.reaches[object_id]
            worst = np.maximum(worst, moved + turned)
        return worst

    def fastest(self, begin: float, end: float) -> float:
        """Largest speed (m/s) of a point of the robot at full rate between two times of the plan."""
        speeds = [0.0]
        for object_id, body in self.bodies.items():
            first, last = int(body.piece(begin)), int(body.piece(end))
            rows = body.numbers[first : last + 1]
            turning = np.linalg.norm(rows[:, 10:13], axis=1) * self.reaches[object_id]
            speeds.append(float((np.linalg.norm(rows[:, 7:10], axis=1) + turning).max()))
        return max(speeds)

    def moving(self, begin: float, end: float) -> Iterable[int]:
        """The objects that move between two times of the plan."""
        for object_id, body in self.bodies.items():
            inner = body.times[(body.times > begin) & (body.times < end)]
            there = self.places(object_id, np.concatenate([[begin], inner, [end]]))
            if np.abs(there - there[0]).max() > MOVES:
                yield object_id


class RateChange(NamedTuple):
    """How the rate of a plan changes from now on, evenly, and then stays.

    begin: time of the plan now (s). rate, target: of its time, 1: as planned. slope: change of the rate in a second.
    """

    begin: float
    rate: float
    target: float
    slope: float

    @property
    def duration(self) -> float:
        """Until the target is reached (s)."""
        return abs(self.target - self.rate) / self.slope

    @property
    def end(self) -> float:
        """The time of the plan then (s)."""
        return self.begin + 0.5 * (self.rate + self.target) * self.duration

    def plan_time(self, seconds: Floats) -> Floats:
        """Times of the plan (T,) some times (T,) from now on (s)."""
        changing = np.clip(seconds, 0.0, self.duration)
        slope = self.slope if self.target > self.rate else -self.slope
        onward = self.target * np.maximum(seconds - self.duration, 0.0)
        return np.asarray(self.begin + self.rate * changing + 0.5 * slope * changing**2 + onward)

    def rate_at(self, seconds: Floats) -> Floats:
        """The rates (T,) some times (T,) from now on (s)."""
        slope = self.slope if self.target > self.rate else -self.slope
        return np.asarray(self.rate + slope * np.clip(seconds, 0.0, self.duration))


class Run(NamedTuple):
    """How a plan is run through from now on, at most: at a rate for `hold` (s), and then to a stop.

    begin: time of the plan now (s). rate: of its time, 1: as planned. slope: by how much the rate falls in a second.
    """

    begin: float
    rate: float
    hold: float
    slope: float

    @property
    def duration(self) -> float:
        """Until it stands (s)."""
        return self.hold + self.rate / self.slope

    def knots(self) -> Floats:
        """Times from now on (s) between which the rate counts as constant."""
        return np.append(0.0, self.hold + np.linspace(0.0, self.rate / self.slope, BRAKING_PARTS + 1))

    def plan_time(self, seconds: Floats) -> Floats:
        """Times of the plan (T,) some times (T,) from now on (s)."""
        braking = RateChange(self.begin + self.rate * self.hold, self.rate, 0.0, self.slope)
        held = self.rate * np.minimum(seconds - self.hold, 0.0)
        return np.asarray(braking.plan_time(np.maximum(seconds - self.hold, 0.0)) + held)

    @property
    def slack(self) -> float:
        """Bound on the error of the plan's time for constant rates between the knots (s)."""
        return self.slope * (self.rate / self.slope / BRAKING_PARTS) ** 2 / 8.0


def run_through(plan: GatedPlan, run: Run) -> dict[int, Trajectory]:
    """The planned motions of the objects that move, with times from now on, as the plan is run through.

    They rest at the end. Tubes are wider by what a constant rate between two knots leaves out.
    """
    seconds = run.knots()
    at = np.minimum(run.plan_time(seconds), plan.end)
    last = int(np.searchsorted(at, at[-1])) + 1  # it may come to the end of the plan before it stands
    seconds, at = seconds[:last], at[:last]
    if len(at) < 2 or not at[-1] - at[0] > 1e-9:
        return {}
    slack = run.slack * plan.fastest(at[0], at[-1])
    found = {}
    for object_id in plan.moving(at[0], at[-1]):
        body = plan.bodies[object_id]
        inner = body.times[(body.times > at[0]) & (body.times < at[-1])]
        times = np.unique(np.concatenate([at, inner]))
        times = times[np.append(True, np.diff(times) > 1e-9)]
        when = np.interp(times, at, seconds)
        kept = np.append(True, np.diff(when) > 1e-9)
        when, times = when[kept], times[kept]
        if len(when) > 1:
            found[object_id] = Trajectory(
                when, plan.places(object_id, times), between=body.between, tube=body.tube + slack
            )
    return found
