"""Check of a parameter file before ROS reads it, because ROS silently ignores parameters for other nodes."""

from __future__ import annotations

from pathlib import Path

from collision_monitor.errors import InputError
from collision_monitor.settings.parameter_file import PARAMETER_SECTION, reaches_monitor, sections_of
from collision_monitor.settings.yaml_file import read_yaml


def check_parameter_file(path: Path) -> None:
    """Raise InputError if the file cannot be read, is not YAML, or holds no parameters for the monitor."""
    try:
        content = read_yaml(path)
    except InputError as error:
        raise InputError(f"--params: {error}") from None
    nodes = sections_of(content)
    if not any(map(reaches_monitor, nodes)):
        found = f"there are settings for {', '.join(nodes)}" if nodes else "there are none"
        raise InputError(
            f"--params: expected settings under `{PARAMETER_SECTION}: ros__parameters:` in {path}, {found}; "
            "config/monitor.yaml is an example"
        )
