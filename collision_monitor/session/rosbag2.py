"""The descriptions by which rosbag2 knows a recording: quality of service of each topic, and the file's metadata."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Final

import yaml

from collision_monitor.session.definitions import type_hash

VERSION: Final = 9
"""Of rosbag2's metadata, as Jazzy writes it."""

_FOREVER = {"sec": 9223372036, "nsec": 854775807}
_QOS: Final = {  # type: depth, reliability, durability; as the node offers and requests them (ros/qos.py)
    "ObjectStateArray": (10, "best_effort", "volatile"),
    "ObjectDescriptionArray": (100, "reliable", "transient_local"),
    "ContactArray": (10, "reliable", "volatile"),
    "PredictedCollisionArray": (10, "reliable", "volatile"),
    "MonitorStatus": (1, "reliable", "transient_local"),
}
TYPES: Final = tuple(_QOS)
"""The messages of `collision_monitor_msgs` that a session holds."""


def full_name(name: str) -> str:
    """`ContactArray` -> `collision_monitor_msgs/msg/ContactArray`."""
    return f"collision_monitor_msgs/msg/{name}"


def qos_profiles(name: str) -> list[dict[str, Any]]:
    """The offered quality of service of a topic of this type."""
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
    """What rosbag2 writes beside each channel."""
    return {
        "offered_qos_profiles": yaml.safe_dump(qos_profiles(name), sort_keys=False),
        "topic_type_hash": type_hash(full_name(name)),
    }


@dataclass(frozen=True)
class Extent:
    """When a recording begins and ends (ns) and the number of messages of each topic."""

    begin: int
    end: int
    counts: Mapping[str, int]


def file_metadata(file_name: str, types: Mapping[str, str], extent: Extent) -> str:
    """metadata.yaml; types: topic -> name of its message."""
    start = {"nanoseconds_since_epoch": extent.begin}
    duration = {"nanoseconds": extent.end - extent.begin}
    count = sum(extent.counts.values())
    topics = [
        {
            "topic_metadata": {
                "name": topic,
                "type": full_name(name),
                "serialization_format": "cdr",
                "offered_qos_profiles": qos_profiles(name),
                "type_description_hash": type_hash(full_name(name)),
            },
            "message_count": extent.counts.get(topic, 0),
        }
        for topic, name in types.items()
    ]
    information = {
        "version": VERSION,
        "storage_identifier": "mcap",
        "duration": dict(duration),
        "starting_time": dict(start),
        "message_count": count,
        "topics_with_message_count": topics,
        "compression_format": "",
        "compression_mode": "",
        "relative_file_paths": [file_name],
        "files": [
            {"path": file_name, "starting_time": dict(start), "duration": dict(duration), "message_count": count}
        ],
        "custom_data": None,
        "ros_distro": "jazzy",
    }
    text: str = yaml.safe_dump({"rosbag2_bagfile_information": information}, sort_keys=False)
    return text
