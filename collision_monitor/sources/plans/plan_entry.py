"""An entry of `plans:` in a sources file: which topic holds the plan of an object.

plans:
  robot:                          # an entry of `objects:`
    topic: /plan                  # nav_msgs/Path, or autoware_planning_msgs/Trajectory
    speed: 0.5                    # m/s, for a Path without stamps
    acceleration: 0.5             # m/s^2, likewise: the robot starts from its speed and ends at rest
    lateral_acceleration: 0.4     # m/s^2, likewise: it is slower in bends
    headings: path                # along the path; or `message`, the orientations in it
    then: rest                    # or `go on`: along the last piece
    tolerance: {across: 0.3, along: 0.5, angle: 0.5, time: 1.0}      # m, m, rad, s
"""

from __future__ import annotations

from dataclasses import dataclass
from math import inf
from typing import Any, Final

from collision_monitor.codec.trajectories import Then
from collision_monitor.errors import InputError
from collision_monitor.motion.trajectory import FASTEST, Tolerance
from collision_monitor.sources.ground.mapping import Mapping
from collision_monitor.sources.ground.yaml_table import known, number, table, text
from collision_monitor.sources.plans.speed_profile import SLOWEST, SpeedLimits

_LIMITS: Final = ("acceleration", "lateral_acceleration")
_KEYS: Final = ("topic", "speed", *_LIMITS, "headings", "then", "tolerance")
_THEN: Final = {"rest": Then.REST, "go on": Then.GO_ON}
GENTLEST: Final = 1e-3
"""m/s^2: the least acceleration. Smaller: a wrong unit."""


@dataclass(frozen=True)
class PlanEntry:
    """Which topic holds the plan of an object. by_path: headings are along the path."""

    name: str
    object_id: int
    topic: str
    limits: SpeedLimits
    by_path: bool
    then: Then
    tolerance: Tolerance


def read_plans(content: Any, mapping: Mapping) -> list[PlanEntry]:
    """Return the entries of `plans:`. Raises InputError."""
    if not isinstance(content, dict) or not content:
        raise InputError(f"plans: expected a table of names of objects, got {content!r:.200}")
    objects = {each.name: each for each in mapping.sources if each.topic and each.shapes and each.marker is None}
    found = []
    for key, value in content.items():
        name = str(key)
        known(name, tuple(objects), "plans")
        found.append(_entry(name, objects[name].object_id, table(value, name, _KEYS)))
    topics = [each.topic for each in found]
    for topic in topics:
        if topic in mapping.topics or topics.count(topic) > 1:
            raise InputError(f"plans: expected a topic of its own for each plan, got {topic} twice")
    return found


def _entry(name: str, object_id: int, given: dict[str, Any]) -> PlanEntry:
    topic = text(given.get("topic", ""), f"{name}, topic")
    if not topic:
        raise InputError(f"{name}, topic: expected the topic of its plan, got none")
    headings, then = given.get("headings", "message"), given.get("then", "rest")
    known(str(headings), ("message", "path"), f"{name}, headings")
    known(str(then), tuple(_THEN), f"{name}, then")
    tolerance = table(given.get("tolerance", {}), f"{name}, tolerance", Tolerance._fields)
    units = dict(zip(Tolerance._fields, ("m", "m", "rad", "s"), strict=True))
    values = {key: number(each, f"{name}, tolerance, {key}", units[key]) for key, each in tolerance.items()}
    if values and not any(Tolerance()._replace(**values)):
        raise InputError(f"{name}, tolerance: expected at least one number above 0, got only zeros")
    return PlanEntry(
        name, object_id, topic, _limits(name, given), headings == "path", _THEN[then], Tolerance()._replace(**values)
    )  # fmt: skip


def _limits(name: str, given: dict[str, Any]) -> SpeedLimits:
    if "speed" not in given:
        for key in _LIMITS:
            if key in given:
                raise InputError(f"{name}, {key}: expected `speed` beside it, the limit on straight ways, got none")
        return SpeedLimits(0.0)
    speed = number(given["speed"], f"{name}, speed", "m/s", least=SLOWEST, most=FASTEST)
    return SpeedLimits(
        speed,
        *(number(given[key], f"{name}, {key}", "m/s^2", least=GENTLEST) if key in given else inf for key in _LIMITS),
    )
