"""The plans of a session: which objects had some, and when one of them left its plan."""

from __future__ import annotations

from typing import Any, Final

import numpy as np

from collision_monitor.codec.trajectories import ObjectTrajectoryArray
from collision_monitor.pipeline.followed_plans import FollowedPlans
from collision_monitor.session.history.history import Floats, PlanUse

KEPT: Final = 20
"""Plans of an object that are kept for the picture, the newest; each with POINTS of its way."""

POINTS: Final = 100

LEAVES: Final = 1000
"""Times at which an object left a plan that are kept; further ones are counted."""


class PlanRows:
    """Follows the plans and the states of a session. Steps are indices."""

    def __init__(self) -> None:
        self._followed = FollowedPlans()
        self._uses: dict[int, PlanUse] = {}

    def take(self, message: ObjectTrajectoryArray) -> None:
        """Take the plans of a message."""
        self._followed.take(message)
        for object_id in sorted({each.object_id for each in message.trajectories} & self._followed.plans.keys()):
            path = self._followed.plans[object_id].path
            use = self._uses.setdefault(object_id, PlanUse(object_id))
            use.count += 1
            times = np.linspace(path.times[0], path.times[-1], POINTS)
            use.ways = [*use.ways[1 - KEPT :], path.rows(times)[:, :3]]

    def move(self, stamp_ns: int, states: Any, step: int) -> None:
        """Take the states of a step."""
        for object_id in self._followed.move(stamp_ns, states):
            use = self._uses[object_id]
            use.times_left += 1
            if len(use.left_steps) < LEAVES:
                use.left_steps.append(step)

    def restart(self) -> None:
        """Forget the plans in force, as the monitor does when time begins anew."""
        self._followed.restart()

    def uses(self, times: Floats) -> list[PlanUse]:
        """Return the objects with plans, by id. times (n,): s of the steps."""
        for use in self._uses.values():
            use.left = [float(times[min(step, len(times) - 1)]) for step in use.left_steps] if len(times) else []
        return [self._uses[each] for each in sorted(self._uses)]
