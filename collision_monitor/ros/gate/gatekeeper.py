"""What a gate decides: whether a plan goes through, and how fast it goes on. Without topics."""

from __future__ import annotations

from collections.abc import Callable
from math import inf
from typing import Final, NamedTuple

from collision_monitor.errors import CollisionMonitorError, InputError
from collision_monitor.ros.gate.answers_without_rules import AnswersWithoutRules
from collision_monitor.ros.gate.execution import Execution
from collision_monitor.ros.gate.gate_limits import GateLimits
from collision_monitor.ros.gate.gated_plan import GatedPlan, RateChange
from collision_monitor.ros.gate.gated_world import GatedWorld
from collision_monitor.ros.gate.plan_conflicts import PlanConflict, Sight, plan_conflicts, self_conflicts
from collision_monitor.ros.guard.guard_limits import GuardLimits
from collision_monitor.ros.guard.guard_report import Decision
from collision_monitor.ros.guard.monitor_answers import ClockReading, Fault
from collision_monitor.ros.guard.speed_limit import PASSES, SpeedVerdict

FARTHEST: Final = 1.0
"""m: larger distances are not told apart."""

FINE: Final = 1e-3
"""m: how exactly the least distance is searched."""

STANDS_STILL: Final = SpeedVerdict(0.0, "", "no plan")


class Judgement(NamedTuple):
    """What stands in the way of a plan: its conflicts, soonest first, or why it cannot be judged; empty: nothing.

    distance: a bound (m) from which on up all distances along the plan are, for certain; infinite: not asked for.
    """

    conflicts: list[PlanConflict]
    refused: str = ""
    distance: float = inf

    @property
    def text(self) -> str:
        """Why the plan does not go through; empty: it does."""
        if self.refused or not self.conflicts:
            return self.refused
        more = f", and {len(self.conflicts) - 1} more" if len(self.conflicts) > 1 else ""
        return f"{told(self.conflicts[0])}{more}"


def told(found: PlanConflict, begin: float = 0.0) -> str:
    """Say which pair, when and where. begin: time of the plan now (s)."""
    x, y, z = found.point
    when = f"at {begin + found.entry[0]:.2f} s of the plan" if begin == 0.0 else f"in {found.entry[0]:.2f} s"
    return f"{found.part} and {found.other}: {found.gap:.3f} m apart {when}, at ({x:.2f}, {y:.2f}, {z:.2f})"


class Gatekeeper:
    """Judges plans, and follows the one that goes through. patterns, base: names of the robot's objects."""

    def __init__(
        self, patterns: tuple[str, ...], base: str, monitor: str, ages: GuardLimits, limits: GateLimits
    ) -> None:  # fmt: skip
        self.world = GatedWorld(patterns, base)
        self.answers = AnswersWithoutRules(monitor, ages, self.world)
        self.limits = limits
        self.execution: Execution | None = None
        self.last = ""  # what became of the last plan

    def fault(self, now: ClockReading) -> Fault | None:
        """Why nothing can be relied on now; None if all can."""
        if now.stamp_ns <= 0:
            return Fault("no clock", "no time on /clock yet, and use_sim_time is set")
        return self.answers.fault(self.world.robot, now)

    def judge(self, make: Callable[[], GatedPlan], now: ClockReading, *, measures: bool = False) -> tuple[
        GatedPlan | None, Judgement
    ]:  # fmt: skip
        """Judge the plan that `make` returns, all of it, against the world as it moves now."""
        if (fault := self.fault(now)) is not None:
            return None, Judgement([], fault.text)
        try:
            plan = make()
            found = self._conflicts(plan, now.stamp_ns, Sight(self.limits.clearance, self.limits.ahead))
            found += self_conflicts(self.world, plan.bodies, plan.end)
            found.sort(key=lambda each: each.entry[0])
            distance = self._distance(plan, now.stamp_ns) if measures else inf
        except CollisionMonitorError as error:
            return None, Judgement([], str(error))
        return plan, Judgement(found, "", distance)

    def _conflicts(self, plan: GatedPlan, now_ns: int, sight: Sight) -> list[PlanConflict]:
        moving = set(plan.moving(0.0, plan.end))
        bodies = {each: body for each, body in plan.bodies.items() if each in moving}
        return plan_conflicts(self.world, bodies, now_ns, plan.end, sight)

    def _distance(self, plan: GatedPlan, now_ns: int) -> float:
        """Bisect the largest clearance that the robot keeps for certain, at the start too."""
        low, high, sight = 0.0, 2.0 * FARTHEST, Sight(0.0, self.limits.ahead, parts=False)
        while high - low > FINE and low < FARTHEST:
            middle = 0.5 * (low + high)
            meets = self._conflicts(plan, now_ns, sight._replace(clearance=middle))
            low, high = (low, middle) if meets else (middle, high)
        return low

    def begin(self, plan: GatedPlan, now_ns: int, *, timed: bool) -> None:
        """Follow a plan from now on, in place of the one before."""
        self.execution = Execution(plan, now_ns, self.limits, timed=timed)
        self.last = ""

    def drop(self, why: str) -> None:
        """Follow no plan any more."""
        self.execution, self.last = None, why

    def decide(self, now: ClockReading) -> tuple[Decision, RateChange | None]:
        """Return what to do now with the plan, and how its rate changes, if it does."""
        fault = self.fault(now)
        it = self.execution
        if it is None:
            reason = fault.text if fault else self.last or STANDS_STILL.reason
            return Decision(SpeedVerdict(0.0, "", reason), fault, refused=bool(self.last)), None
        if fault is not None:
            return Decision(SpeedVerdict(0.0, "", fault.text), fault), self._change(it, 0.0, now.stamp_ns)
        if it.plan.bodies.keys() != self.world.own.keys():
            raise LeftPlanError("the objects of the robot have changed since the plan: it needs a new one")
        if left := it.follow(self.world, now.stamp_ns):
            raise LeftPlanError(left)
        rate, found = it.look(self.world, now.stamp_ns)
        if rate > it.change.target and not it.may_raise(now.stamp_ns):
            rate = it.change.target
        reason = "" if found is None or rate == 1.0 else told(found, max(it.progress.time, 1e-3))
        where = f"at {it.progress.time:.2f} of {it.plan.end:.2f} s of the plan"
        verdict = (
            PASSES if rate == 1.0 else SpeedVerdict(rate, found.other if found else "", f"{reason or 'waits'}; {where}")
        )
        return Decision(verdict), self._change(it, rate, now.stamp_ns)

    @staticmethod
    def _change(it: Execution, rate: float, now_ns: int) -> RateChange | None:
        return None if rate == it.change.target else it.go_on_at(rate, now_ns)


class LeftPlanError(InputError):
    """The robot does not follow its plan any more."""
