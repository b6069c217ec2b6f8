"""Objects with plans and a static world, as files hold them, on one clock."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any, NamedTuple

from collision_monitor.errors import InputError
from collision_monitor.motion.trajectory import Trajectory
from collision_monitor.shapes.pose import Pose
from collision_monitor.shapes.registry import Shape

Parts = tuple[tuple[Shape, Pose], ...]


class DatedPlan(NamedTuple):
    """A plan whose time 0 is at a stamp (ns)."""

    zero_ns: int
    plan: Trajectory


@dataclass
class PlannedScene:
    """Objects by their names. left_out: texts about what was not used. ignored: pairs of names that may touch."""

    shapes: dict[str, Parts] = field(default_factory=dict)
    plans: dict[str, DatedPlan] = field(default_factory=dict)
    static: dict[str, tuple[Parts, Pose]] = field(default_factory=dict)
    left_out: list[str] = field(default_factory=list)
    ignored: list[tuple[str, str]] = field(default_factory=list)

    def add(self, other: PlannedScene, what: str) -> None:
        """Add another scene. what: its file, for the error. Raises InputError for a name that is there already."""
        for name in [*other.shapes, *other.static]:
            if name in self.shapes or name in self.static:
                raise InputError(f"{what}, {name}: expected a name that no other object has, got it twice")
        self.shapes |= other.shapes
        self.plans |= other.plans
        self.static |= other.static
        self.left_out += other.left_out
        self.ignored += other.ignored

    @property
    def begin_ns(self) -> int:
        """The first point of all plans (ns)."""
        return min((each.zero_ns + round(float(each.plan.times[0]) * 1e9) for each in self.plans.values()), default=0)

    def trajectories(self) -> dict[str, Trajectory]:
        """The plans, with times from the begin on."""
        begin = self.begin_ns
        return {name: _later(each.plan, (each.zero_ns - begin) * 1e-9) for name, each in self.plans.items()}


def _later(plan: Trajectory, seconds: float) -> Trajectory:
    if seconds == 0.0:
        return plan
    times: Any = plan.times + seconds
    known: Any = {name: getattr(plan, name) for name in ("twists", "accelerations", "between", "then", "tube")}
    return Trajectory(times, plan.poses, **known)
