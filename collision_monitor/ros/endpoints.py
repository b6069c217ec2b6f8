"""Publishers and subscriptions of the monitor's topics, with the message class and quality of service of each topic."""

from __future__ import annotations

from collections.abc import Callable
from importlib import import_module
from typing import Any, Final

from rclpy.duration import Duration
from rclpy.event_handler import PublisherEventCallbacks
from rclpy.lifecycle import LifecycleNode, LifecyclePublisher
from rclpy.node import Node
from rclpy.publisher import Publisher
from rclpy.qos import DurabilityPolicy, LivelinessPolicy, QoSProfile, ReliabilityPolicy
from rclpy.subscription import Subscription

from collision_monitor.pipeline.topics import Topic

ALIVE_S: Final = 0.8
"""Deadline and lease of the liveliness (s) that the node offers on its answers, so that a subscriber that requests 1 s
notices a dead node within it. The liveliness is asserted by each message and by the node twice a second, not by DDS
itself, so it is lost as well if the node hangs. The deadline is missed as well if no states arrive."""

_ANSWERS: Final = (Topic.CONTACTS, Topic.PREDICTIONS, Topic.STATUS)


def quality_of(topic: Topic) -> QoSProfile:
    """Return the quality of service that a subscriber needs, without a deadline."""
    depth, reliability, durability = topic.quality
    return QoSProfile(
        depth=depth,
        reliability=ReliabilityPolicy[reliability.upper()],
        durability=DurabilityPolicy[durability.upper()],
    )


def message_class(type_name: str) -> Any:
    """Return the generated class of a type such as `nav_msgs/msg/Odometry`.

    Raises ImportError or AttributeError if it is not installed.
    """
    package, _, name = type_name.split("/")
    return getattr(import_module(f"{package}.msg"), name)


def publisher(node: Node, topic: Topic, name: str | None = None) -> Publisher:
    """Create a publisher. name: the topic's full name; None: below the node's own."""
    return node.create_publisher(message_class(topic.type_name), name or topic.private, quality_of(topic))


def answer_publisher(
    node: LifecycleNode, topic: Topic, events: PublisherEventCallbacks | None = None
) -> LifecyclePublisher:
    """Create a publisher that is silent while the node is inactive; answers have a deadline and a liveliness."""
    quality = quality_of(topic)
    if topic in _ANSWERS:
        quality.deadline = quality.liveliness_lease_duration = Duration(seconds=ALIVE_S)
        quality.liveliness = LivelinessPolicy.MANUAL_BY_TOPIC
    kind = message_class(topic.type_name)
    return node.create_lifecycle_publisher(kind, topic.private, quality, event_callbacks=events)


def subscription(
    node: Node, topic: Topic, callback: Callable[[bytes], object], name: str | None = None
) -> Subscription:
    """Create a subscription whose callback gets the bytes of each message. name: as of `publisher`."""
    kind = message_class(topic.type_name)
    return node.create_subscription(kind, name or topic.private, callback, quality_of(topic), raw=True)


def take_waiting(subscription: Subscription) -> bytes | None:
    """Take the next message that waits for a subscription of `subscription`; None: none waits."""
    with subscription.handle:
        taken = subscription.handle.take_message(subscription.msg_type, subscription.raw)
    return None if taken is None else taken[0]
