"""The folder of a bag of rosbag2: its metadata.yaml names the files, and how many messages of each topic they hold."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final

from collision_monitor.errors import InputError, SessionError
from collision_monitor.settings.regular_file import found_instead
from collision_monitor.settings.yaml_file import read_yaml

_METADATA: Final = "metadata.yaml"

_VALUES: Final = 50_000
"""Values in metadata.yaml: those of 1,000 topics and 1,000 files."""


@dataclass(frozen=True)
class BagFolder:
    """files: in their order. counts: messages of each topic, as the metadata state them."""

    files: tuple[Path, ...]
    counts: dict[str, int] = field(default_factory=dict)


def read_bag_folder(folder: Path) -> BagFolder:
    """Read the metadata of a bag. Only the names of files and topics and the numbers of messages are used.

    Raises SessionError if they are not there, or if a file is missing.
    """
    if found_instead(folder / _METADATA):
        raise SessionError(
            f"{folder}: expected the folder of a bag, got one without {_METADATA}; "
            "name the .mcap file in it, or make it with `ros2 bag reindex`"
        )
    try:
        content = read_yaml(folder / _METADATA, aliases=True, nodes=_VALUES)
    except InputError as error:
        raise SessionError(f"{error}; expected a bag of rosbag2") from None
    table = content.get("rosbag2_bagfile_information") if isinstance(content, dict) else None
    names = table.get("relative_file_paths") if isinstance(table, dict) else None
    if not isinstance(table, dict) or not isinstance(names, list) or not names:
        raise SessionError(f"{folder / _METADATA}: expected the relative_file_paths of a bag, got {names!r:.80}")
    files = tuple(folder / Path(str(name)).name for name in names)  # older versions wrote a path with the folder
    for file in files:
        if found := found_instead(file):
            raise SessionError(f"{file}: expected a file of the bag, as its {_METADATA} says, got {found}")
    return BagFolder(files, _counts(table.get("topics_with_message_count")))


def _counts(topics: Any) -> dict[str, int]:
    found: dict[str, int] = {}
    for each in topics if isinstance(topics, list) else ():
        about = each.get("topic_metadata") if isinstance(each, dict) else None
        if not isinstance(about, dict):
            continue
        name, count = about.get("name"), each.get("message_count")
        if isinstance(name, str) and isinstance(count, int):
            found[name] = found.get(name, 0) + count
    return found
