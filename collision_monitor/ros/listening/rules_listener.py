"""The rules in force in a running monitor, as it last published them."""

from __future__ import annotations

import time

import rclpy
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from rclpy.executors import SingleThreadedExecutor
from rclpy.qos import DurabilityPolicy, QoSProfile

from collision_monitor.pipeline.topics import RULES_IN_FORCE
from collision_monitor.ros.names import check_node_name


def heard_rules(monitor: str, seconds: float) -> list[DiagnosticStatus] | None:
    """Return a status for each rule of a monitor; None if it published none within `seconds`.

    monitor: the full name of the node without the first slash. Raises InputError for a name that no node can have.
    """
    check_node_name(monitor)
    node = rclpy.create_node("collision_monitor_rules")
    heard: list[DiagnosticArray] = []
    latched = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
    node.create_subscription(DiagnosticArray, f"/{monitor}/{RULES_IN_FORCE.removeprefix('~/')}", heard.append, latched)
    executor = SingleThreadedExecutor()
    executor.add_node(node)
    try:
        end = time.monotonic() + seconds
        while not heard and (left := end - time.monotonic()) > 0.0:
            executor.spin_once(timeout_sec=left)
    finally:
        executor.shutdown()
        node.destroy_node()
    return list(heard[-1].status) if heard else None
