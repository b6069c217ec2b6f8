"""The answers of the monitor for a gate, which looks at the world itself and needs no rules."""

from __future__ import annotations

from collision_monitor.codec import CollisionAlertArray
from collision_monitor.ros.gate.gated_world import GatedWorld
from collision_monitor.ros.guard.guard_limits import GuardLimits
from collision_monitor.ros.guard.guarded_objects import GuardedObjects
from collision_monitor.ros.guard.monitor_answers import ClockReading, Fault, MonitorAnswers


class AnswersWithoutRules(MonitorAnswers):
    """As of a guard, but every object counts: whatever the sources file asks for may stand in the way of a plan."""

    def __init__(self, monitor: str, limits: GuardLimits, world: GatedWorld) -> None:
        super().__init__(monitor, limits)
        self._world = world

    def lost(self, robot: GuardedObjects, now: ClockReading) -> Fault | None:
        """See MonitorAnswers. Objects of the robot that stand have no states."""
        moving = {each: name for each, name in robot.names.items() if not self._world.described[each].static}
        found = (self.state_fault(each, name, robot, now) for each, name in moving.items())
        return next((each for each in found if each), None) or self._world.unknown(now, self.limits.obstacle)

    def uncovered(self, array: CollisionAlertArray, robot: GuardedObjects) -> Fault | None:
        """See MonitorAnswers."""
        return None

    def missing(self, array: CollisionAlertArray, robot: GuardedObjects) -> Fault | None:
        """See MonitorAnswers."""
        for each in array.unmonitored:
            if not each.is_silent:
                return Fault(f"missing {each.name}", f"not monitored: {each.name or 'a topic'}: {each.reason}")
        return None
