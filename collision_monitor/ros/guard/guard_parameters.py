"""Reads and checks the parameters of the guard."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

from rcl_interfaces.msg import ParameterDescriptor
from rclpy.node import Node

from collision_monitor.errors import InputError
from collision_monitor.ros.guard.guard_limits import GuardLimits
from collision_monitor.ros.guard.guard_options import BASE, MONITOR, NAMES, NUMBERS, ROBOT, STAMPED, NumberParameter
from collision_monitor.ros.guard.speed_limit import Braking
from collision_monitor.ros.parameters import ParameterReader
from collision_monitor.settings.parameter_file import NODE


@dataclass(frozen=True)
class GuardParameters:
    """The checked parameters. patterns: names of the robot's objects. base: that of the commands' frame."""

    patterns: tuple[str, ...]
    base: str
    monitor: str
    stamped: bool
    limits: GuardLimits
    braking: Braking


def read_guard_parameters(node: Node) -> GuardParameters:
    """Read, check and declare the parameters. Raises InputError."""
    reader = ParameterReader(node, NAMES)
    patterns, base = read_robot(reader)
    monitor = reader.read("monitor", NODE, MONITOR).strip("/")
    stamped = reader.read("stamped", False, STAMPED)
    numbers = read_numbers(reader, NUMBERS)
    limits = GuardLimits(*numbers[:4])
    braking = Braking(*numbers[4:])
    braking = replace(braking, reaction=max(braking.reaction, limits.max_age))  # for so long it relies on one answer
    return GuardParameters(patterns, base, monitor, stamped, limits, braking)


def read_robot(reader: ParameterReader) -> tuple[tuple[str, ...], str]:
    """Read and declare `robot` and `base`: the names of the objects, and that of the frame. Raises InputError."""
    patterns = _names(reader.given("robot"))
    robot = ",".join(patterns)
    reader.declare("robot", robot, ParameterDescriptor(description=ROBOT, read_only=True))
    base = reader.read("base", "", BASE) or (patterns[0] if patterns else "")
    if not patterns:
        raise InputError("parameter robot: expected the name of the robot's object, got an empty text")
    if any(letter in base for letter in "*?["):
        raise InputError(
            f"parameter base: expected the name of the object whose frame the commands have, got {base!r}, which has a "
            "wildcard: name it with -p base:=NAME"
        )
    return patterns, base


def read_numbers(reader: ParameterReader, table: Sequence[NumberParameter]) -> list[float]:
    """Read and declare the numbers of a table. Raises InputError for one out of range."""
    values = [reader.read(each.name, each.default, _described(each)) for each in table]
    for each, value in zip(table, values, strict=True):
        if not each.least <= value <= each.most:
            raise InputError(f"parameter {each.name}: expected {each.least:g} to {each.most:g}, got {value:g}")
    return values


def _names(given: Any) -> tuple[str, ...]:
    """Return the names in a text, separated by commas, or in a list of texts. Raises InputError."""
    if given is None:
        return ()
    texts = [given] if isinstance(given, str) else given
    if isinstance(texts, int | float) or not all(isinstance(each, str) for each in texts):
        raise InputError(f"parameter robot: expected a text or a list of texts, got {given!r}")
    return tuple(name for text in texts for each in text.split(",") if (name := each.strip()))


def _described(each: NumberParameter) -> str:
    return f"{each.text} Unit: {each.unit}." if each.unit else each.text
