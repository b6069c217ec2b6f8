"""Names of nodes and topics that ROS accepts, checked before rclpy raises an error of its own."""

from __future__ import annotations

from rclpy.exceptions import InvalidTopicNameException
from rclpy.validate_full_topic_name import validate_full_topic_name
from rclpy.validate_topic_name import validate_topic_name

from collision_monitor.errors import InputError
from collision_monitor.pipeline.topics import Topic


def check_node_name(name: str) -> None:
    """Raise InputError if a monitor's full name, without the first slash, cannot be that of a node."""
    try:
        validate_full_topic_name(Topic.STATUS.of(name))
    except InvalidTopicNameException:
        raise InputError(f"monitor: expected a node's name of letters, digits and underscores, got {name!r}") from None


def is_topic_name(name: str) -> bool:
    """Whether ROS accepts the name of a topic, which may be relative."""
    try:
        return bool(validate_topic_name(name))
    except InvalidTopicNameException:
        return False
