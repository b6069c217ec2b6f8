"""The parameters of our nodes, checked when a node starts.

The settings of the profile define most parameters of the monitor; these may change while it runs (`live_settings.py`).
The frame, the recording and the executor are read-only.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, TypeVar

from rcl_interfaces.msg import FloatingPointRange, IntegerRange, ParameterDescriptor
from rclpy.node import Node

from collision_monitor.alerts.rules import Rules
from collision_monitor.errors import InputError, ProfileError, SessionError
from collision_monitor.pipeline.settings_event import PROFILE, RULES
from collision_monitor.ros.health.diagnostics import DiagnosticsParameters
from collision_monitor.session import ONE_FILE, Splitting
from collision_monitor.settings.names import nearest_name
from collision_monitor.settings.parameter_file import OTHER_PARAMETERS, PARAMETERS_BY_RCLPY
from collision_monitor.settings.profile import Profile
from collision_monitor.settings.setting import Setting
from collision_monitor.sources.ground.mapping import Mapping, load_mapping

T = TypeVar("T", str, int, float, bool, str | int | float)

_TYPES = {bool: "true or false", str: "a text", int: "a whole number", float: "a number"}


def begin_node(node: Node, name: str) -> None:
    """Initialise a node whose parameters a ParameterReader reads. Raises InputError for a value without a type."""
    try:
        Node.__init__(node, name, automatically_declare_parameters_from_overrides=True)
    except ValueError as error:
        raise InputError(f"parameters: expected a value with a type for each, got an empty list: {error}") from None


class ParameterReader:
    """Declares the parameters of a node and returns their values.

    The node is one of `begin_node`, which declares what is given. So this class can refuse a misspelt name,
    which ROS would ignore, and accept a whole number for a decimal one (`-p horizon:=1`). Raises InputError.
    """

    def __init__(self, node: Node, names: Sequence[str]) -> None:
        self._node = node
        self._given = {name: parameter.value for name, parameter in node.get_parameters_by_prefix("").items()}
        for name in self._given:
            if name in names or name.startswith(PARAMETERS_BY_RCLPY):
                continue
            raise InputError(f"parameter {name!r} is unknown: {nearest_name(name, names)}")

    def value(self, name: str, default: T) -> T:
        """Return the given value, or the default. The type of the default is the expected type. Raises InputError."""
        value = self._given.get(name, default)
        if isinstance(default, float) and type(value) is int:
            value = float(value)
        if type(value) is not type(default):
            raise InputError(f"parameter {name}: expected {_TYPES[type(default)]}, got {value!r}")
        result: T = value
        return result

    def declare(self, name: str, value: Any, descriptor: ParameterDescriptor) -> None:
        """Declare the parameter with its value, description and range, for `ros2 param`."""
        if self._node.has_parameter(name):
            self._node.undeclare_parameter(name)
        self._node.declare_parameter(name, value, descriptor, ignore_override=True)

    def read(self, name: str, default: T, description: str) -> T:
        """Return the value and declare the parameter read-only."""
        value = self.value(name, default)
        self.declare(name, value, ParameterDescriptor(description=description, read_only=True))
        return value

    def given(self, name: str) -> Any:
        """Return the given value without a check of its type; None if none was given."""
        return self._given.get(name)


DEFAULT_FRAME = "world"
EXECUTORS = ("single", "events")
RECORD_MODES = ("always", "on_event")


@dataclass(frozen=True)
class MonitorParameters:
    """The checked parameters of the monitor."""

    profile: Profile
    frame_id: str
    record: str
    executor: str
    keep_up: bool = True
    splitting: Splitting = ONE_FILE
    autostart: bool = True
    diagnostics: DiagnosticsParameters = field(default_factory=DiagnosticsParameters)
    sources: Mapping | None = None
    rules: Rules = field(default_factory=Rules)


def read_monitor_parameters(node: Node) -> MonitorParameters:
    """Read, check and declare the parameters. Raises InputError; ProfileError for a setting out of range."""
    settings = Profile.fields()
    reader = ParameterReader(node, [PROFILE, *(s.name for s in settings), *OTHER_PARAMETERS])
    name = reader.value(PROFILE, "balanced")
    profile = Profile.named(name)
    given = {s.name: plain(reader.given(s.name), s) for s in settings if reader.given(s.name) is not None}
    profile = profile.replace(**given)
    choices = (
        f"Name of the profile that the settings start from: {', '.join(Profile.names())}, or the path of a .yaml file."
    )
    reader.declare(PROFILE, name, ParameterDescriptor(description=choices))
    for setting in settings:
        reader.declare(setting.name, getattr(profile, setting.name), _descriptor(setting))

    text = "Frame of all poses; messages in another frame are refused. A sources file sets it."
    frame_id = reader.read("frame_id", DEFAULT_FRAME, text)
    sources = _read_sources(reader, frame_id)
    rules = _read_rules(reader)
    record = reader.read(
        "record", "", "Path of the session to write: a .mcap file or a folder. Without one, nothing is recorded."
    )
    splitting = _read_splitting(reader)
    executor = reader.read("executor", "single", f"Executor of rclpy that runs the node: {' or '.join(EXECUTORS)}.")
    if not frame_id:
        raise ProfileError("parameter frame_id: expected the name of a frame, got an empty text")
    if executor not in EXECUTORS:
        raise ProfileError(f"parameter executor: expected {' or '.join(EXECUTORS)}, got {executor!r}")
    text = (
        "Whether to leave out outdated states, and to use more threads and fewer samples, while steps take longer than "
        "the period of the states."
    )
    keep_up = reader.read("keep_up", True, text)
    text = "Whether the node configures and activates itself. If not, a lifecycle manager or ros2 lifecycle does it."
    autostart = reader.read("autostart", True, text)
    return MonitorParameters(
        profile,
        sources.frame if sources else frame_id,
        record,
        executor,
        keep_up,
        splitting,
        sources=sources,
        rules=rules,
        autostart=autostart,
        diagnostics=_read_diagnostics(reader),
    )


def _read_diagnostics(reader: ParameterReader) -> DiagnosticsParameters:
    """Read the parameters that diagnostic_updater has too. Raises InputError."""
    default = DiagnosticsParameters()
    period = reader.read(
        "diagnostic_updater.period", default.period, "Time between two messages on /diagnostics. Unit: s."
    )
    text = "Whether the names on /diagnostics begin with the node's full name, namespace included."
    use_fqn = reader.read("diagnostic_updater.use_fqn", default.use_fqn, text)
    if not 0.01 <= period <= 3600.0:
        raise InputError(f"parameter diagnostic_updater.period: expected 0.01 to 3600 s, got {period:g}")
    return DiagnosticsParameters(period, use_fqn)


def _read_sources(reader: ParameterReader, frame_id: str) -> Mapping | None:
    """Read the sources file. Raises InputError."""
    path = reader.read(
        "sources", "", "Path of a YAML file with the topics of other programs to monitor. Without one, there are none."
    )
    if not path:
        return None
    mapping = load_mapping(Path(path))
    if frame_id not in (DEFAULT_FRAME, mapping.frame):
        raise InputError(f"parameter frame_id: expected that of {path}, {mapping.frame!r}, got {frame_id!r}")
    return mapping


def _read_rules(reader: ParameterReader) -> Rules:
    """Read the rules of the alerts. Raises InputError with the file and the line."""
    value = reader.value(RULES, "")
    rules = Rules.given(value)
    text = "Path of a YAML file with the rules of the alerts, or the YAML itself. Without rules, there are no alerts."
    reader.declare(RULES, value, ParameterDescriptor(description=text))
    return rules


def _read_splitting(reader: ParameterReader) -> Splitting:
    """Read the parameters of a recording in several files. Raises InputError."""
    mode = reader.read(
        "record_mode",
        RECORD_MODES[0],
        "When to record: always, or on_event, which keeps only the time around collisions.",
    )
    before = reader.read(
        "record_before", ONE_FILE.before, "Time kept before each collision with record_mode on_event. Unit: s."
    )
    after = reader.read(
        "record_after",
        ONE_FILE.after,
        "Time kept after the begin of each collision with record_mode on_event. Unit: s.",
    )
    size = reader.read(
        "record_split_size", ONE_FILE.size, "Size at which the recording starts a new file. With 0, never. Unit: bytes."
    )
    duration = reader.read(
        "record_split_duration",
        ONE_FILE.duration,
        "Duration after which the recording starts a new file. With 0, never. Unit: s.",
    )
    if mode not in RECORD_MODES:
        raise InputError(f"parameter record_mode: expected {' or '.join(RECORD_MODES)}, got {mode!r}")
    try:
        return Splitting(size, duration, mode == "on_event", before, after)
    except SessionError as error:
        raise InputError(f"parameters record_split_* and record_*: {error}") from None


def plain(value: Any, setting: Setting) -> Any:
    """Return a parameter's value in the form that a setting checks: an array as a tuple."""
    return tuple(value) if setting.type is tuple and not isinstance(value, str | int | float) else value


def _descriptor(setting: Setting) -> ParameterDescriptor:
    unit = "" if setting.unit == "1" else f" Unit: {setting.unit}."
    descriptor = ParameterDescriptor(description=f"{setting.description}{unit}")
    if setting.choices:
        descriptor.additional_constraints = f"one of {', '.join(setting.choices)}"
    elif setting.type is int:
        low, high = int(setting.minimum), int(setting.maximum)
        descriptor.integer_range = [IntegerRange(from_value=low, to_value=high, step=1)]
    elif setting.type is float:
        least, most = float(setting.minimum), float(setting.maximum)
        descriptor.floating_point_range = [FloatingPointRange(from_value=least, to_value=most, step=0.0)]
    return descriptor
