"""Publishers and subscriptions of the monitor's topics, with the message class and quality of service of each topic."""

from __future__ import annotations

from collections.abc import Callable
from importlib import import_module
from typing import Any

from rclpy.node import Node
from rclpy.publisher import Publisher
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from rclpy.subscription import Subscription

from collision_monitor.pipeline.topics import Topic


def quality_of(topic: Topic) -> QoSProfile:
    """Return the quality of service, which is the same for the publisher and for every subscriber."""
    depth, reliability, durability = topic.quality
    return QoSProfile(
        depth=depth,
        reliability=ReliabilityPolicy[reliability.upper()],
        durability=DurabilityPolicy[durability.upper()],
    )


def message_class(topic: Topic) -> Any:
    """Return the generated class of the topic's message."""
    package, _, name = topic.type_name.split("/")
    return getattr(import_module(f"{package}.msg"), name)


def publisher(node: Node, topic: Topic, name: str | None = None) -> Publisher:
    """Create a publisher. name: the topic's full name; None: below the node's own."""
    return node.create_publisher(message_class(topic), name or topic.private, quality_of(topic))


def subscription(
    node: Node, topic: Topic, callback: Callable[[bytes], object], name: str | None = None
) -> Subscription:
    """Create a subscription whose callback gets the bytes of each message. name: as of `publisher`."""
    return node.create_subscription(message_class(topic), name or topic.private, callback, quality_of(topic), raw=True)
