"""Check of a parameter file before ROS reads it, because ROS silently ignores parameters for other nodes."""

from __future__ import annotations

from pathlib import Path

from collision_monitor.errors import InputError
from collision_monitor.pipeline.topics import NODE, PARAMETER_SECTION
from collision_monitor.settings.yaml_file import read_yaml


def check_parameter_file(path: Path) -> None:
    """Raise InputError if the file cannot be read, is not YAML, or holds no parameters for the monitor."""
    try:
        content = read_yaml(path)
    except InputError as error:
        raise InputError(f"--params: {error}") from None
    nodes = [name for name, value in content.items() if _holds_parameters(value)] if isinstance(content, dict) else []
    if not any(str(name).rstrip("*").rstrip("/") == "" or str(name).rsplit("/", 1)[-1] == NODE for name in nodes):
        found = f"there are settings for {', '.join(map(str, nodes))}" if nodes else "there are none"
        raise InputError(
            f"--params: expected settings under `{PARAMETER_SECTION}: ros__parameters:` in {path}, {found}; "
            "config/monitor.yaml is an example"
        )


def _holds_parameters(value: object) -> bool:
    return isinstance(value, dict) and isinstance(value.get("ros__parameters"), dict)
