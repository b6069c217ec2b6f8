"""Which object follows which plan, as the messages of a monitor tell it: for reports and viewers."""

from __future__ import annotations

from collections.abc import Collection
from typing import Any, Final, NamedTuple

import numpy as np

from collision_monitor.codec.trajectories import ObjectTrajectoryArray
from collision_monitor.errors import CollisionMonitorError
from collision_monitor.monitor.state.timeline import NANOSECOND
from collision_monitor.motion.plan_deviation import is_off_plan
from collision_monitor.motion.trajectory import Tolerance, Trajectory
from collision_monitor.pipeline.plan_intake import tolerance_of, trajectory_of

MOST_PLANS: Final = 10_000
"""Plans that are kept. Further ones are left out, because anybody can name other objects."""


class FollowedPlan(NamedTuple):
    """A plan, its time 0 (ns) and its tolerance."""

    stamp_ns: int
    path: Trajectory
    tolerance: Tolerance

    @property
    def ends_ns(self) -> int:
        """When it is over (ns)."""
        return self.stamp_ns + round((float(self.path.times[-1]) + self.tolerance.time) / NANOSECOND)

    def seconds(self, stamp_ns: int) -> float:
        """The time on the plan (s) at a stamp (ns)."""
        return (stamp_ns - self.stamp_ns) * NANOSECOND


class FollowedPlans:
    """The last plan of each object, by id, and who left it. plans: those in force; left: ids without one since."""

    def __init__(self) -> None:
        self.plans: dict[int, FollowedPlan] = {}
        self.left: set[int] = set()

    def copy(self) -> FollowedPlans:
        """Return plans that go on without changing these."""
        other = FollowedPlans()
        other.plans, other.left = dict(self.plans), set(self.left)
        return other

    def take(self, message: ObjectTrajectoryArray) -> None:
        """Take new plans. Those that the monitor refuses are left out."""
        for given in message.trajectories:
            self.left.discard(given.object_id)
            if not len(given.times):
                self.plans.pop(given.object_id, None)
                continue
            try:
                plan = FollowedPlan(message.stamp_ns, trajectory_of(given), tolerance_of(given))
            except CollisionMonitorError:
                continue
            if given.object_id in self.plans or len(self.plans) < MOST_PLANS:
                self.plans[given.object_id] = plan

    def move(self, stamp_ns: int, states: Any) -> list[int]:
        """Take states (N,) of records.STATE at a stamp. Return the ids of the objects that leave their plans."""
        if not self.plans:
            return []
        found = []
        for k in np.flatnonzero(np.isin(states["id"], list(self.plans))):
            object_id = int(states["id"][k])
            plan = self.plans[object_id]
            if stamp_ns > plan.ends_ns:
                del self.plans[object_id]
            elif is_off_plan(plan.path, plan.tolerance, np.array([plan.seconds(stamp_ns)]), states[k : k + 1])[0]:
                del self.plans[object_id]
                self.left.add(object_id)
                found.append(object_id)
        return found

    def forget(self, ids: Collection[int]) -> None:
        """Forget the plans of these objects."""
        for object_id in ids:
            self.plans.pop(object_id, None)
            self.left.discard(object_id)

    def restart(self) -> None:
        """Forget all plans, as the monitor does when time begins anew."""
        self.plans, self.left = {}, set()
