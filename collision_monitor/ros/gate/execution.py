"""A plan while it is executed: where on it the robot is, and how fast it may go on."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from collision_monitor.ros.gate.gate_limits import GateLimits
from collision_monitor.ros.gate.gated_plan import GatedPlan, RateChange, Run, run_through
from collision_monitor.ros.gate.gated_world import GatedWorld
from collision_monitor.ros.gate.plan_conflicts import PlanConflict, Sight, plan_conflicts

Floats = NDArray[np.float64]

RATES: Final = (1.0, 0.6, 0.3, 0.1)
"""Rates that are tried, the first that is clear counts. More: smoother, and longer looks while the way is blocked."""

AGAIN: Final = 0.3
"""s from a change of the rate to the next one that raises it."""

TIMES: Final = 81
"""Times of the plan among which the one is searched at which the robot is."""

AS_NEAR: Final = 2e-3
"""m: places of the plan this much farther from the robot than the nearest are as near; the expected time decides."""


@dataclass(frozen=True)
class PlanProgress:
    """Where on the plan the robot is (s), and how far off it is (m)."""

    time: float
    off: float


class Execution:
    """A plan that goes on, from its begin, at a time (ns). timed: whether the controller runs through it by the clock.

    A controller that does not, such as the follower of a path, is where its robot is seen.
    """

    def __init__(self, plan: GatedPlan, now_ns: int, limits: GateLimits, *, timed: bool) -> None:
        self.plan, self.limits, self.timed = plan, limits, timed
        self.change = RateChange(0.0, 1.0, 1.0, 1.0 / limits.stop_time)
        self.changed_ns = self.began_ns = now_ns
        self.progress = PlanProgress(0.0, 0.0)

    # -- where it is

    def commanded(self, now_ns: int) -> float:
        """Commanded time of the plan (s)."""
        if not self.timed:
            return self.progress.time
        return float(np.clip(self.change.plan_time(self._since(now_ns)), 0.0, self.plan.end)[0])

    def rate(self, now_ns: int) -> float:
        """Commanded rate."""
        return float(self.change.rate_at(self._since(now_ns))[0])

    def _since(self, now_ns: int) -> Floats:
        return np.array([max((now_ns - self.changed_ns) * 1e-9, 0.0)])

    def follow(self, world: GatedWorld, now_ns: int) -> str:
        """Find where on the plan the robot is. Return why it does not follow it; empty: it does."""
        measured = {}
        for each in self.plan.bodies:
            motion = None if world.described[each].static else world.motion(each, now_ns)
            if motion is not None:
                measured[each] = np.array(motion.pose.numbers)
        if not measured:
            return ""
        expected, late = self.commanded(now_ns), self.limits.time_tolerance
        times = np.linspace(max(expected - late, 0.0), min(expected + late, self.plan.end), TIMES)
        off = self.plan.off(measured, times)
        near = np.flatnonzero(off <= off.min() + AS_NEAR)
        k = int(near[np.abs(times[near] - expected).argmin()])
        self.progress = PlanProgress(float(times[k]), float(off[k]))
        return "" if off[k] <= self.limits.tolerance else self._why(measured, float(off[k]), expected, now_ns)

    def _why(self, measured: dict[int, Floats], off: float, expected: float, now_ns: int) -> str:
        """Say how the robot left the plan."""
        times = np.linspace(0.0, self.plan.end, 10 * TIMES)
        everywhere = self.plan.off(measured, times)
        k = int(everywhere.argmin())
        if not self.timed or everywhere[k] > self.limits.tolerance:
            return f"the robot left the plan: it is {off:.3f} m off"
        waited = (now_ns - self.began_ns) * 1e-9
        if times[k] < 1e-2 * self.plan.end:
            return f"the controller has not started for {waited:.2f} s"
        word = "late" if times[k] < expected else "early"
        return f"the robot is {abs(times[k] - expected):.2f} s {word} on the plan"

    def is_over(self, now_ns: int) -> bool:
        """Whether a plan that goes by the clock came to its end so long ago that a late robot is there too."""
        if not self.timed or self.change.target == 0.0:
            return False
        before = np.maximum(self._since(now_ns) - self.limits.time_tolerance, 0.0)
        return bool(self.change.plan_time(before)[0] >= self.plan.end)

    # -- how it goes on

    def look(self, world: GatedWorld, now_ns: int) -> tuple[float, PlanConflict | None]:
        """Return the largest rate at which the robot stays able to stop before any conflict, and what limits it."""
        first: PlanConflict | None = None
        for rate in RATES:
            found = self._conflict(world, now_ns, max(rate, self.rate(now_ns) if self.timed and rate < 1.0 else rate))
            if found is None:
                return rate, first
            first = first or found
        return 0.0, first

    def _conflict(self, world: GatedWorld, now_ns: int, rate: float) -> PlanConflict | None:
        commanded, limits = self.commanded(now_ns), self.limits
        begin = min(self.progress.time, commanded)
        run = Run(begin, rate, limits.reaction + (commanded - begin) / rate, 1.0 / limits.stop_time)
        sight = Sight(limits.clearance + self.progress.off, limits.ahead)
        found = plan_conflicts(world, run_through(self.plan, run), now_ns, run.duration, sight)
        return found[0] if found else None

    def may_raise(self, now_ns: int) -> bool:
        """Whether the rate has stayed for long enough to be raised."""
        return (now_ns - self.changed_ns) * 1e-9 >= AGAIN

    def go_on_at(self, target: float, now_ns: int) -> RateChange:
        """Change the rate from now on, and return how."""
        begin, rate = self.commanded(now_ns), self.rate(now_ns) if self.timed else target
        self.change = RateChange(begin, rate, target, 1.0 / self.limits.stop_time)
        self.changed_ns = now_ns
        return self.change
