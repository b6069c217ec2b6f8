"""The metadata that rosbag2 expects of a recording: quality of service of each topic, and that of the file."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Final

import yaml

from collision_monitor.pipeline.topics import Topic
from collision_monitor.session.mcap.definitions import type_hash

_METADATA_VERSION: Final = 9
"""Version of rosbag2's metadata that Jazzy writes."""

_FOREVER = {"sec": 9223372036, "nsec": 854775807}
_TOPICS: Final = (
    *(Topic.STATES, Topic.SHAPES, Topic.CONTACTS, Topic.PREDICTIONS, Topic.STATUS, Topic.SETTINGS, Topic.ALERTS),
    *(Topic.SOURCES, Topic.TRAJECTORIES),
)
_QOS: Final = {topic.message: topic.quality for topic in _TOPICS}
_FULL_NAMES: Final = {topic.message: topic.type_name for topic in _TOPICS}
RECORDED_TYPES: Final = tuple(_QOS)
"""The message types that a session holds."""

INPUT_TYPES: Final = (Topic.STATES.message, Topic.SHAPES.message, Topic.TRAJECTORIES.message)
"""The types that the monitor subscribes to; all others are its answers and settings."""


def full_name(name: str) -> str:
    """Return the full name: `ContactArray` -> `collision_monitor_msgs/msg/ContactArray`."""
    return _FULL_NAMES.get(name, f"collision_monitor_msgs/msg/{name}")


def qos_profiles(name: str) -> list[dict[str, Any]]:
    """Return the offered quality of service of a topic of this type."""
    depth, reliability, durability = _QOS[name]
    return [
        {
            "history": "keep_last",
            "depth": depth,
            "reliability": reliability,
            "durability": durability,
            "deadline": dict(_FOREVER),
            "lifespan": dict(_FOREVER),
            "liveliness": "automatic",
            "liveliness_lease_duration": dict(_FOREVER),
            "avoid_ros_namespace_conventions": False,
        }
    ]


def channel_metadata(name: str) -> dict[str, str]:
    """Return the metadata that rosbag2 writes for each channel."""
    return {
        "offered_qos_profiles": yaml.safe_dump(qos_profiles(name), sort_keys=False),
        "topic_type_hash": type_hash(full_name(name)),
    }


@dataclass(frozen=True)
class FileInformation:
    """Begin and end of a recording (ns), and the number of messages of each topic."""

    begin: int
    end: int
    counts: Mapping[str, int]

    @property
    def count(self) -> int:
        """Number of messages of all topics."""
        return sum(self.counts.values())


def file_metadata(files: Mapping[str, FileInformation], types: Mapping[str, str]) -> str:
    """Return the text of metadata.yaml. files: by name, in their order. types: topic -> message name."""
    filled = [information for information in files.values() if information.count]
    begin = min((information.begin for information in filled), default=0)
    end = max((information.end for information in filled), default=0)
    topics = [
        {
            "topic_metadata": {
                "name": topic,
                "type": full_name(name),
                "serialization_format": "cdr",
                "offered_qos_profiles": qos_profiles(name),
                "type_description_hash": type_hash(full_name(name)),
            },
            "message_count": sum(information.counts.get(topic, 0) for information in files.values()),
        }
        for topic, name in types.items()
    ]
    content = {
        "version": _METADATA_VERSION,
        "storage_identifier": "mcap",
        "duration": {"nanoseconds": end - begin},
        "starting_time": {"nanoseconds_since_epoch": begin},
        "message_count": sum(information.count for information in files.values()),
        "topics_with_message_count": topics,
        "compression_format": "",
        "compression_mode": "",
        "relative_file_paths": list(files),
        "files": [
            {
                "path": name,
                "starting_time": {"nanoseconds_since_epoch": information.begin},
                "duration": {"nanoseconds": information.end - information.begin},
                "message_count": information.count,
            }
            for name, information in files.items()
        ],
        "custom_data": None,
        "ros_distro": "jazzy",
    }
    text: str = yaml.safe_dump({"rosbag2_bagfile_information": content}, sort_keys=False)
    return text
