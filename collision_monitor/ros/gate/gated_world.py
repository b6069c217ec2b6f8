"""The world as a gate sees it: all objects that the monitor monitors, and how they move now."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from collision_monitor.codec import ObjectDescriptionArray, ObjectStateArray, Removal
from collision_monitor.monitor.state.timeline import NANOSECOND
from collision_monitor.motion.stated_motion import LINEAR, Motion, motion_of
from collision_monitor.motion.trajectory import carried
from collision_monitor.objects.description import ObjectDescription
from collision_monitor.records import StateFlag
from collision_monitor.robots.link_plans import radius_of
from collision_monitor.ros.durations import spoken
from collision_monitor.ros.guard.guarded_objects import GuardedObjects
from collision_monitor.ros.guard.monitor_answers import ClockReading, Fault
from collision_monitor.shapes.pose import Pose

Floats = NDArray[np.float64]


class MeasuredMotion(NamedTuple):
    """The last state of an object: its motion from the stamp (ns) on, and when it arrived (steady s)."""

    motion: Motion
    stamp_ns: int
    arrived: float


class GatedWorld:
    """Follows descriptions and states. patterns: names of the robot's objects, with wildcards. base: one of them.

    robot: the robot's objects. described: all objects by id. measured: the last states of those that move. reaches:
    radii (m) of the objects about their origins; infinite for a half-space.
    """

    def __init__(self, patterns: tuple[str, ...], base: str) -> None:
        self.robot = GuardedObjects(patterns, base)
        self.described: dict[int, ObjectDescription] = {}
        self.measured: dict[int, MeasuredMotion] = {}
        self.reaches: dict[int, float] = {}

    @property
    def own(self) -> dict[int, ObjectDescription]:
        """The robot's objects."""
        return {each: self.described[each] for each in self.robot.names if each in self.described}

    @property
    def others(self) -> dict[int, ObjectDescription]:
        """All other objects."""
        return {each: it for each, it in self.described.items() if each not in self.robot.names}

    def describe(self, message: ObjectDescriptionArray) -> None:
        """Take over descriptions; a snapshot replaces all."""
        self.robot.describe(message)
        measured, names = dict(self.measured), {each: it.name for each, it in self.described.items()}
        if message.snapshot:
            for known in (self.described, self.measured, self.reaches):
                known.clear()
        for each in message.objects:
            if isinstance(each, Removal):
                self.described.pop(each.object_id, None)
                self.measured.pop(each.object_id, None)
                self.reaches.pop(each.object_id, None)
            else:
                self.described[each.object_id] = each
                self.reaches[each.object_id] = radius_of(each.shapes)
        if message.snapshot:  # which comes with every new subscriber of the monitor, and changes no place
            named = {each: it.name for each, it in self.described.items()}
            self.measured = {each: it for each, it in measured.items() if named.get(each) == names[each]}

    def move(self, message: ObjectStateArray, arrived: float) -> None:
        """Take over states. One that is not finite is left out, so that its object grows old."""
        self.robot.move(message, arrived)
        for row in message.states:
            object_id = int(row["id"])
            last = self.measured.get(object_id)
            if object_id in self.described and (last is None or message.stamp_ns > last.stamp_ns):
                motion = _motion(row)
                if motion is not None:
                    self.measured[object_id] = MeasuredMotion(motion, message.stamp_ns, arrived)

    def motion(self, object_id: int, now_ns: int) -> Motion | None:
        """How an object moves from now on; None if it has no state yet."""
        it = self.described[object_id]
        if it.static:
            return None if it.pose is None else Motion(it.pose)
        last = self.measured.get(object_id)
        if last is None:
            return None
        row = np.array([[*last.motion.pose.numbers, *last.motion.numbers]])
        now = carried(row, np.array([(now_ns - last.stamp_ns) * NANOSECOND]))[0]
        return motion_of(Pose.of_numbers(now[:LINEAR].tolist()), now)

    def unknown(self, now: ClockReading, max_age: float) -> Fault | None:
        """Return the first object in the world about whose place too little is known; None if there is none.

        max_age: s without a new state.
        """
        for object_id, it in self.others.items():
            if it.static:
                continue
            last = self.measured.get(object_id)
            if last is None:
                return Fault(f"no state {it.name}", f"no state of {it.name!r} so far")
            age = max(now.steady - last.arrived, (now.stamp_ns - last.stamp_ns) * NANOSECOND)
            if age > max_age:
                return Fault(f"no state {it.name}", f"no state of {it.name!r} for {spoken(age)}")
        return None


def _motion(row: np.void) -> Motion | None:
    """The motion that a state (records.STATE) says; None if it is not finite. An unknown twist counts as none."""
    numbers = [np.array(row[name]) for name in ("position", "quaternion", "linear", "angular", "acceleration")]
    if not all(np.isfinite(each).all() for each in numbers[:2]):
        return None
    position, quaternion, *moves = numbers
    flags = int(row["flags"])
    if flags & StateFlag.TWIST_UNKNOWN:
        moves = [np.zeros(3)] * 3
    linear, angular, acceleration = (each if np.isfinite(each).all() else np.zeros(3) for each in moves)
    frame = "body" if flags & StateFlag.BODY_TWIST else "world"
    pose = Pose(position, quaternion / np.linalg.norm(quaternion))
    return Motion(pose, linear, angular, acceleration, frame, stops=bool(flags & StateFlag.STOPS))  # type: ignore[arg-type]
