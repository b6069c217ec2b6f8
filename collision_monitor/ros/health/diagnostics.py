"""`/diagnostics` by the conventions of diagnostic_updater: names, parameters, period and quality of service.

The package itself is not among the ROS 2 wheels, and needs nothing that is not here.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from rclpy.clock import Clock
from rclpy.clock_type import ClockType
from rclpy.node import Node
from rclpy.qos import QoSProfile

from collision_monitor.ros.health.health import Report

TOPIC: Final = "/diagnostics"
HARDWARE_ID: Final = "none"
"""The monitor watches no device of its own; diagnostic_updater uses this word."""


@dataclass(frozen=True)
class DiagnosticsParameters:
    """period: s between two messages. use_fqn: whether the names begin with the node's full name."""

    period: float = 1.0
    use_fqn: bool = False


class Diagnostics:
    """Publishes reports once per period, in every state of the node. reports: called for them."""

    def __init__(self, node: Node, reports: Callable[[], list[Report]], parameters: DiagnosticsParameters) -> None:
        self._node, self._reports = node, reports
        self._prefix = node.get_fully_qualified_name() if parameters.use_fqn else node.get_name()
        self._out = node.create_publisher(DiagnosticArray, TOPIC, QoSProfile(depth=1))
        node.create_timer(parameters.period, self.publish, clock=Clock(clock_type=ClockType.STEADY_TIME))

    def publish(self) -> None:
        """Publish the reports of now."""
        array = DiagnosticArray()
        array.header.stamp = self._node.get_clock().now().to_msg()
        array.status = [
            DiagnosticStatus(
                level=bytes([report.level]),
                name=f"{self._prefix}: {report.task}",
                message=report.text,
                hardware_id=HARDWARE_ID,
                values=[KeyValue(key=key, value=value) for key, value in report.values.items()],
            )
            for report in self._reports()
        ]
        self._out.publish(array)
