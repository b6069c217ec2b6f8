"""Protective separation distance of speed and separation monitoring, by ISO/TS 15066:2016, 5.5.4."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from collision_monitor.settings.yaml_entry import YamlEntry

Array = NDArray[np.float64]

WALKING_SPEED = 1.6
"""m/s: the speed of a person that ISO/TS 15066 and ISO 13855 assume where it is not measured."""


@dataclass(frozen=True)
class ProtectiveSeparation:
    """What the distance is made of; times in s, lengths in m, speeds in m/s, deceleration in m/s².

    reaction_time (Tr): from the person's entry to the command to stop. stopping_time (Ts): from there to standstill, at
    full speed; deceleration: in place of it, with which the robot brakes. human_speed: least speed of the person toward
    the robot that is assumed; a higher measured one counts. intrusion (C): how far a part of the body reaches before it
    is sensed. human_uncertainty (Zd), robot_uncertainty (Zr): errors of the positions.
    """

    reaction_time: float
    stopping_time: float = 0.0
    deceleration: float = 0.0
    human_speed: float = WALKING_SPEED
    intrusion: float = 0.0
    human_uncertainty: float = 0.0
    robot_uncertainty: float = 0.0

    def distance(self, robot_speed: Array, human_speed: Array) -> Array:
        """Return Sp = Sh + Sr + Ss + C + Zd + Zr (m).

        robot_speed, human_speed (n,): m/s toward the other, by equations (2) to (8) with constant speeds until the
        stop. Negative speeds count as 0.
        """
        robot = np.maximum(robot_speed, 0.0)
        human = np.maximum(human_speed, self.human_speed)
        if self.deceleration:
            stopping_time = robot / self.deceleration
            braking = 0.5 * robot * stopping_time
        else:
            stopping_time = np.full_like(robot, self.stopping_time)
            braking = robot * stopping_time  # Ss at the speed of the begin: an upper bound whatever the braking is
        moved = human * (self.reaction_time + stopping_time)
        fixed = self.intrusion + self.human_uncertainty + self.robot_uncertainty
        return np.asarray(moved + robot * self.reaction_time + braking + fixed)


_KEYS = tuple(ProtectiveSeparation.__dataclass_fields__)


def read_protective_separation(entry: YamlEntry) -> ProtectiveSeparation:
    """Read the table of a rule. Raises InputError."""
    content = entry.table(_KEYS)
    if "reaction_time" not in content:
        raise entry.error("reaction_time (s)", "none")
    if ("stopping_time" in content) == ("deceleration" in content):
        raise entry.error(
            "either stopping_time (s) or deceleration (m/s²)", "both" if "deceleration" in content else "none"
        )
    values = {}
    for key, each in content.items():
        least = 1e-3 if key == "deceleration" else 0.0
        unit = (
            "s" if key.endswith("_time") else "m/s²" if key == "deceleration" else "m/s" if "speed" in key else "metres"
        )
        values[key] = each.number(unit, least, 1000.0)
    return ProtectiveSeparation(**values)
