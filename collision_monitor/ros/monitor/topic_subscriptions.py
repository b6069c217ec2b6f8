"""Subscriptions to topics of other programs, with the quality of service that all of their publishers offer.

A publisher that comes later may offer less, and DDS would give nothing of it. Then the topic is subscribed anew.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any, Final

from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from rclpy.subscription import Subscription

from collision_monitor.ros.endpoints import message_class

_DEPTH: Final = {"/tf": 100, "/tf_static": 100}
"""Depth of the queue; 10 for the other topics."""


@dataclass
class _Subscribed:
    """A topic of the file. resolved: its name on the graph."""

    resolved: str
    kind: str
    quality: QoSProfile
    subscription: Subscription


class TopicSubscriptions:
    """on_message: called with topic, type and bytes of each message."""

    def __init__(self, node: Node, on_message: Callable[[str, str, bytes], None]) -> None:
        self._node, self._on_message = node, on_message
        self._topics: dict[str, _Subscribed] = {}

    def add(self, topic: str, resolved: str, kind: str, infos: list[Any]) -> QoSProfile:
        """Subscribe to a topic. infos: of its publishers. Return the quality of service."""
        quality = quality_of_all(topic, infos)
        subscription = self._node.create_subscription(
            message_class(kind), resolved, lambda data: self._on_message(topic, kind, data), quality, raw=True
        )
        self._topics[topic] = _Subscribed(resolved, kind, quality, subscription)
        return quality

    def look_again(self) -> Iterator[tuple[str, list[str]]]:
        """Subscribe anew where a publisher offers less. Yield each topic with its types that are not taken."""
        for topic, known in list(self._topics.items()):
            infos = self._node.get_publishers_info_by_topic(known.resolved)
            if infos and _offers_less(quality_of_all(topic, infos), known.quality):
                self._node.destroy_subscription(known.subscription)
                self.add(topic, known.resolved, known.kind, infos)
                self._node.get_logger().info(f"source {topic}: subscribed anew, as a publisher offers less")
            yield topic, sorted({info.topic_type for info in infos} - {known.kind})


def _offers_less(offered: QoSProfile, asked: QoSProfile) -> bool:
    if asked.reliability is ReliabilityPolicy.RELIABLE and offered.reliability is not ReliabilityPolicy.RELIABLE:
        return True
    latched = DurabilityPolicy.TRANSIENT_LOCAL
    return asked.durability is latched and offered.durability is not latched


def quality_of_all(topic: str, infos: list[Any]) -> QoSProfile:
    """Return the strictest quality of service that all publishers of a topic offer."""
    offered = [info.qos_profile for info in infos]
    reliable = all(each.reliability is ReliabilityPolicy.RELIABLE for each in offered)
    latched = reliable and all(each.durability is DurabilityPolicy.TRANSIENT_LOCAL for each in offered)
    return QoSProfile(
        depth=_DEPTH.get(topic, 10),
        reliability=ReliabilityPolicy.RELIABLE if reliable else ReliabilityPolicy.BEST_EFFORT,
        durability=DurabilityPolicy.TRANSIENT_LOCAL if latched else DurabilityPolicy.VOLATILE,
    )
