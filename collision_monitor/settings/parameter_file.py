"""The sections of a ROS parameter file that reach the monitor. ROS silently ignores those of other nodes."""

from __future__ import annotations

from typing import Any, Final

NODE: Final = "object_monitor"
"""The node's name unless it is remapped."""

PARAMETER_SECTION: Final = f"/**/{NODE}"
"""The section of a parameter file for the node, in any namespace."""

_PARAMETERS: Final = "ros__parameters"

OTHER_PARAMETERS: Final = (
    "frame_id", "sources", "rules",
    "record", "record_mode", "record_before", "record_after", "record_split_size", "record_split_duration",
    "executor", "keep_up", "autostart", "diagnostic_updater.period", "diagnostic_updater.use_fqn",
)  # fmt: skip
"""Parameters of the node beside `profile` and the settings."""

PARAMETERS_BY_RCLPY: Final = ("use_sim_time", "start_type_description_service", "qos_overrides.")
"""How parameters begin that rclpy declares for each node."""


def sections_of(content: Any) -> dict[str, dict[str, Any]]:
    """Return the parameters of each node in the content of a YAML file; none if it is no parameter file."""
    found = content.items() if isinstance(content, dict) else ()
    return {
        str(name): value[_PARAMETERS]
        for name, value in found
        if isinstance(value, dict) and isinstance(value.get(_PARAMETERS), dict)
    }


def reaches_monitor(section: str) -> bool:
    """Return whether the parameters of a section are for the monitor: a wildcard, or its name in any namespace."""
    return section.rstrip("*").rstrip("/") == "" or section.rsplit("/", 1)[-1] == NODE


def is_other_parameter(name: str) -> bool:
    """Return whether a parameter of the node is none of the settings, nor `profile`. Tables of YAML are prefixes."""
    others = (*OTHER_PARAMETERS, *PARAMETERS_BY_RCLPY)
    return name in others or any(each.startswith(f"{name}.") for each in others) or name.startswith(PARAMETERS_BY_RCLPY)
