"""A subscriber that keeps the newest contacts, predictions and status of a monitor, as bytes."""

from __future__ import annotations

import time
from collections.abc import Callable

import rclpy
from rclpy.executors import SingleThreadedExecutor

from collision_monitor.pipeline.topics import NODE, Topic
from collision_monitor.ros.endpoints import subscription


class Viewer:
    """Raw subscriptions, so that messages are not decoded before they are drawn. None: no message yet."""

    def __init__(self, monitor: str = NODE) -> None:
        self.contacts: bytes | None = None
        self.predictions: bytes | None = None
        self.status: bytes | None = None
        self._node = rclpy.create_node("viewer")
        for topic in (Topic.CONTACTS, Topic.PREDICTIONS, Topic.STATUS):
            subscription(self._node, topic, self._keep(topic.path), topic.of(monitor))
        self._executor = SingleThreadedExecutor()
        self._executor.add_node(self._node)

    def _keep(self, name: str) -> Callable[[bytes], None]:
        return lambda data: setattr(self, name, data)

    def listen(self, until: float) -> None:
        """Receive messages until this time of the monotonic clock (s)."""
        while (left := until - time.monotonic()) > 0.0:
            self._executor.spin_once(timeout_sec=left)

    def close(self) -> None:
        """Shut the executor down and destroy the node."""
        self._executor.shutdown()
        self._node.destroy_node()
