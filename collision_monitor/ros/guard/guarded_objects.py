"""The objects of the robot that a guard guards: which of the monitor's objects its names mean, and where they are."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from collision_monitor.alerts.name_patterns import matches
from collision_monitor.codec import ObjectDescriptionArray, ObjectStateArray, Removal
from collision_monitor.motion.moved_states import in_world
from collision_monitor.records import StateFlag
from collision_monitor.ros.guard.speed_limit import PartPose


class LastState(NamedTuple):
    """The last state of an object: where it is, the stamp of the message (ns), and when it arrived (steady s)."""

    pose: PartPose
    stamp_ns: int
    arrived: float


class GuardedObjects:
    """Follows descriptions and states. patterns: names with wildcards. base: the name of the object whose frame the
    commands have; it is one of the robot's.

    names: of the robot's objects, by id. states: their last ones.
    """

    def __init__(self, patterns: tuple[str, ...], base: str) -> None:
        self.patterns = tuple(dict.fromkeys((base, *patterns)))
        self.names: dict[int, str] = {}
        self.states: dict[int, LastState] = {}
        self._base_name = base
        self._others: dict[int, str] = {}

    @property
    def base(self) -> int | None:
        """The id of the base; None if it is not described."""
        return next((object_id for object_id, name in self.names.items() if name == self._base_name), None)

    def name(self, object_id: int) -> str:
        """Return the name of any object, for people."""
        return self.names.get(object_id) or self._others.get(object_id) or f"object {object_id}"

    def without_objects(self) -> list[str]:
        """Return the patterns that no object matches."""
        names = self.names.values()
        return [each for each in self.patterns if not any(matches(each, name) for name in names)]

    def describe(self, message: ObjectDescriptionArray) -> None:
        """Take over descriptions. A snapshot, which comes with every new subscriber, replaces all; places stay."""
        states, names = dict(self.states), dict(self.names)
        if message.snapshot:
            for known in (self.names, self.states, self._others):
                known.clear()
        for each in message.objects:
            self.names.pop(each.object_id, None)
            self._others.pop(each.object_id, None)
            if isinstance(each, Removal):
                self.states.pop(each.object_id, None)
            elif any(matches(pattern, each.name) for pattern in self.patterns):
                self.names[each.object_id] = each.name
            else:
                self._others[each.object_id] = each.name
                self.states.pop(each.object_id, None)
        if message.snapshot:
            self.states = {each: it for each, it in states.items() if self.names.get(each) == names[each]}

    def move(self, message: ObjectStateArray, arrived: float) -> None:
        """Take over the states of the robot's objects. A state that is not finite, or not newer, is left out."""
        for row in message.states[np.isin(message.states["id"], list(self.names))]:
            object_id = int(row["id"])
            last = self.states.get(object_id)
            if last is not None and message.stamp_ns == last.stamp_ns:
                continue  # a stamp that stands still is no news
            if pose := _pose(row):
                self.states[object_id] = LastState(pose, message.stamp_ns, arrived)


def _pose(row: np.void) -> PartPose | None:
    """Where a state (records.STATE) says an object is, and how it moves, in the world; None if it is not finite."""
    if int(row["flags"]) & StateFlag.BODY_TWIST:
        (row,) = in_world(np.array([row]))
    position, linear, angular = (tuple(row[name].tolist()) for name in ("position", "linear", "angular"))
    x, y, z, w = row["quaternion"].tolist()
    if not all(map(math.isfinite, (*position, x, y, z, w))):
        return None
    heading = math.atan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z))
    # an unknown velocity counts as none: then all of a closing speed is the obstacle's
    linear, angular = (v if all(map(math.isfinite, v)) else (0.0, 0.0, 0.0) for v in (linear, angular))
    return PartPose(position, heading, linear, angular)
