"""A plan as a caller gives it, checked against the object and the time."""

from __future__ import annotations

from typing import Any, NamedTuple

from collision_monitor.checks.numbers import checked_array
from collision_monitor.errors import InputError
from collision_monitor.monitor.intake import checked_nanoseconds
from collision_monitor.monitor.plans import ENDED
from collision_monitor.monitor.state.roster import Roster
from collision_monitor.monitor.state.timeline import Timeline
from collision_monitor.motion.trajectory import Tolerance, Trajectory


class GivenPlan(NamedTuple):
    """zero: time 0 of the plan (s after the origin); None: there is no origin yet."""

    plan: Trajectory
    tolerance: Tolerance
    zero: float | None


def checked_plan(
    roster: Roster, timeline: Timeline, object_id: int, plan: Any, stamp_ns: Any, tolerance: Any
) -> GivenPlan:  # fmt: skip
    """Return the plan of a known object; in a scene of the plane without height and tilt.

    stamp_ns: time 0 of the plan as a stamp; None: now. Raises InputError, see `Monitor.follow`.
    """
    name = f"object {object_id}"
    if not isinstance(plan, Trajectory):
        raise InputError(f"{name}: expected a Trajectory or None, got {type(plan).__name__}")
    if roster.bodies.static[roster.slot(object_id)]:
        raise InputError(f"{name}: expected an object that moves, got a static one")
    if plan.then == "unknown":
        raise InputError(f"{name}: expected a plan that says what comes after its end, 'rest' or 'go on'")
    stamp, zero = None if stamp_ns is None else checked_nanoseconds(stamp_ns, "stamp_ns"), None
    if timeline.has_begun:
        zero = timeline.now if stamp is None else timeline.seconds(stamp)
        if zero + plan.times[-1] < timeline.now:
            raise InputError(ENDED.format(id=object_id, late=timeline.now - zero - plan.times[-1]))
    numbers = checked_array(tolerance, "tolerance", least=0.0)
    if numbers.shape != (len(Tolerance._fields),):
        raise InputError(f"tolerance: expected a Tolerance of {len(Tolerance._fields)} numbers, got {tolerance!r:.100}")
    return GivenPlan(plan.flat() if roster.planar else plan, Tolerance(*numbers.tolist()), zero)
