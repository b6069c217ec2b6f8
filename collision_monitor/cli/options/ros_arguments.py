"""Conversion of command line options to ROS parameters."""

from __future__ import annotations

import json
from pathlib import Path


def parameters(**values: str | int | float | Path | None) -> list[str]:
    """Return `-p name:=value` for each value that is not None. The list follows --ros-args.

    ROS reads the values as YAML. Strings are quoted, so that a file named `7` or `yes` stays a string.
    """
    found = []
    for name, value in values.items():
        if value is not None:
            text = json.dumps(str(value)) if isinstance(value, str | Path) else repr(value)
            found += ["-p", f"{name}:={text}"]
    return found
