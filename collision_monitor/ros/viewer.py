"""A third party that only listens: keeps the newest contacts, predictions and status of a monitor, as bytes."""

from __future__ import annotations

import time
from collections.abc import Callable

import rclpy
from rclpy.executors import SingleThreadedExecutor

from collision_monitor.ros import qos
from collision_monitor_msgs.msg import ContactArray, MonitorStatus, PredictedCollisionArray


class Viewer:
    """Raw subscriptions: nothing is decoded before it is drawn. None: nothing heard yet."""

    def __init__(self, monitor: str = "object_monitor") -> None:
        self.contacts: bytes | None = None
        self.predictions: bytes | None = None
        self.status: bytes | None = None
        self._node = rclpy.create_node("viewer")
        for message, topic, quality in (
            (ContactArray, "contacts", qos.ANSWERS),
            (PredictedCollisionArray, "predictions", qos.ANSWERS),
            (MonitorStatus, "status", qos.STATUS),
        ):
            self._node.create_subscription(message, f"/{monitor}/{topic}", self._keep(topic), quality, raw=True)
        self._executor = SingleThreadedExecutor()
        self._executor.add_node(self._node)

    def _keep(self, topic: str) -> Callable[[bytes], None]:
        return lambda data: setattr(self, topic, data)

    def listen(self, until: float) -> None:
        """Take what arrives until this time of the monotonic clock."""
        while (left := until - time.monotonic()) > 0.0:
            self._executor.spin_once(timeout_sec=left)

    def close(self) -> None:
        """Leave ROS."""
        self._executor.shutdown()
        self._node.destroy_node()
