"""Reads and checks the parameters of the gate."""

from __future__ import annotations

from dataclasses import dataclass, replace

from rclpy.node import Node

from collision_monitor.errors import InputError
from collision_monitor.ros.gate.gate_limits import GateLimits
from collision_monitor.ros.gate.gate_options import AGES, LIMITS, NAMES, STAMPED, TEXTS
from collision_monitor.ros.guard.guard_limits import GuardLimits
from collision_monitor.ros.guard.guard_parameters import read_numbers, read_robot
from collision_monitor.ros.parameters import ParameterReader


@dataclass(frozen=True)
class GateParameters:
    """The checked parameters. patterns: names of the robot's objects. base: the one that a Path is for."""

    patterns: tuple[str, ...]
    base: str
    monitor: str
    urdf: str
    urdf_topic: str
    joint_states: str
    carrier: str
    stamped: bool
    ages: GuardLimits
    limits: GateLimits

    @property
    def is_arm(self) -> bool:
        """Whether the robot is one of a URDF, which follows joint trajectories."""
        return bool(self.urdf or self.urdf_topic)


def read_gate_parameters(node: Node) -> GateParameters:
    """Read, check and declare the parameters. Raises InputError."""
    reader = ParameterReader(node, NAMES)
    patterns, base = read_robot(reader)
    texts = {name: reader.read(name, default, text) for name, default, text in TEXTS if name != "base"}
    stamped = reader.read("stamped", False, STAMPED)
    ages, limits = GuardLimits(*read_numbers(reader, AGES)), GateLimits(*read_numbers(reader, LIMITS))
    if texts["urdf"] and texts["urdf_topic"]:
        raise InputError("parameter urdf: expected `urdf` or `urdf_topic`, got both")
    limits = replace(limits, reaction=max(limits.reaction, ages.max_age))  # for so long it relies on one answer
    texts["monitor"] = texts["monitor"].strip("/")
    return GateParameters(patterns, base, stamped=stamped, ages=ages, limits=limits, **texts)
