"""A third party that only listens: keeps the newest contacts, predictions and status of a monitor, as bytes."""

from __future__ import annotations

import time
from collections.abc import Callable

import rclpy
from rclpy.executors import SingleThreadedExecutor

from collision_monitor.pipeline.topics import NODE, Topic
from collision_monitor.ros.endpoints import subscription


class Viewer:
    """Raw subscriptions: nothing is decoded before it is drawn. None: nothing heard yet."""

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
        """Take what arrives until this time of the monotonic clock."""
        while (left := until - time.monotonic()) > 0.0:
            self._executor.spin_once(timeout_sec=left)

    def close(self) -> None:
        """Leave ROS."""
        self._executor.shutdown()
        self._node.destroy_node()
