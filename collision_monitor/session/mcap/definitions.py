"""Text and hash of a message type. Sessions hold them so that any reader can decode the messages."""

from __future__ import annotations

import json
import os
import re
import sys
from collections.abc import Iterator
from functools import cache
from pathlib import Path

from collision_monitor.errors import SessionError
from collision_monitor.settings.regular_file import found_instead, read_regular

_LARGEST = 1 << 20
_SEPARATOR = "=" * 80
_FIELD = re.compile(r"^\s*(?:([a-z]\w*)/)?([A-Z]\w*)(?:\[[^]]*\])?\s+[a-z]\w*", re.MULTILINE)


def definition(type_name: str) -> str:
    """Return the definition of `package/msg/Name`, then those of all nested types (rosbag2's `ros2msg`).

    Raises SessionError if no ROS prefix or source tree holds one of them.
    """
    names = [type_name]
    for name in names:  # the loop appends to it
        package = name.split("/")[0]
        for other, nested in _FIELD.findall(_read(name, "msg")):
            full = f"{other or package}/msg/{nested}"
            if full not in names:
                names.append(full)
    rest = [f"{_SEPARATOR}\nMSG: {name.replace('/msg/', '/')}\n{_read(name, 'msg')}" for name in names[1:]]
    return "\n".join([_read(type_name, "msg"), *rest])


def type_hash(type_name: str) -> str:
    """Return the RIHS01 hash of the installed type description; empty if only the sources are there."""
    try:
        description = json.loads(_read(type_name, "json"))
    except (SessionError, ValueError):
        return ""
    hashes = {each["type_name"]: each["hash_string"] for each in description["type_hashes"]}
    return str(hashes.get(type_name, ""))


def _read(type_name: str, suffix: str) -> str:
    package, _, name = type_name.split("/")
    for root in _roots():
        path = root / package / "msg" / f"{name}.{suffix}"
        if not found_instead(path):
            return read_regular(path, most=_LARGEST, refused=SessionError).decode(errors="replace")
    if suffix == "msg" and type_name in _carried():
        return _carried()[type_name]
    raise SessionError(
        f"{type_name}: expected {package}/msg/{name}.{suffix} under a ROS prefix (AMENT_PREFIX_PATH, {sys.prefix}), "
        "got none: build and source collision_monitor_msgs"
    )


@cache
def _carried() -> dict[str, str]:
    """Return the package's own copy of the definitions that a session needs, by name, for machines without ROS."""
    sections = (Path(__file__).with_name("definitions.txt")).read_text(encoding="utf-8").split(f"{_SEPARATOR}\nMSG: ")
    found = {}
    for section in sections[1:]:
        name, _, text = section.partition("\n")
        package, _, message = name.partition("/")
        found[f"{package}/msg/{message}"] = text.removesuffix("\n")
    return found


def _roots() -> Iterator[Path]:
    """Yield the folders of installed packages, then the source tree of this one."""
    for prefix in [*os.environ.get("AMENT_PREFIX_PATH", "").split(os.pathsep), sys.prefix]:
        if prefix:
            yield Path(prefix) / "share"
    yield Path(__file__).parents[3]
