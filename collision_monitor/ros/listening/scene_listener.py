"""A subscriber to all that the view shows: what a monitor monitors and its answers, as bytes."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Final

import rclpy
from rclpy.executors import SingleThreadedExecutor

from collision_monitor.pipeline.topics import Topic
from collision_monitor.ros.endpoints import subscription
from collision_monitor.ros.names import check_node_name

TOPICS: Final = (
    *(Topic.MONITORED_SHAPES, Topic.MONITORED_STATES, Topic.MONITORED_PLANS, Topic.CONTACTS, Topic.PREDICTIONS),
    *(Topic.RAISED_ALERTS, Topic.STATUS),
)


class SceneListener:
    """Passes each message to `take` with its type, such as `ContactArray`.

    monitor: the full name of the node without the first slash. arrived: monotonic time (s) of the last answers; None
    before the first. Raises InputError for a name that no node can have.
    """

    def __init__(self, monitor: str, take: Callable[[str, bytes], None]) -> None:
        self.arrived: float | None = None
        self._take = take
        check_node_name(monitor)
        self._node = rclpy.create_node("view")
        for topic in TOPICS:
            subscription(self._node, topic, self._taking(topic), topic.of(monitor))
        self._executor = SingleThreadedExecutor()
        self._executor.add_node(self._node)

    def _taking(self, topic: Topic) -> Callable[[bytes], None]:
        def take(data: bytes) -> None:
            if topic is Topic.CONTACTS:
                self.arrived = time.monotonic()
            self._take(topic.message, data)

        return take

    def listen(self, until: float) -> None:
        """Receive messages until this time of the monotonic clock (s), and at least those that wait."""
        self._executor.spin_once(timeout_sec=0.0)
        while (left := until - time.monotonic()) > 0.0:
            self._executor.spin_once(timeout_sec=left)

    def close(self) -> None:
        """Shut the executor down and destroy the node."""
        self._executor.shutdown()
        self._node.destroy_node()
