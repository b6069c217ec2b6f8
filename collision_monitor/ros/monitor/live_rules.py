"""Rules of the alerts that change while the monitor runs, by the parameter `rules` or by a latched topic.

ros2 param set /object_monitor rules night.yaml
"""

from __future__ import annotations

from collections.abc import Callable

from rcl_interfaces.msg import SetParametersResult
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.qos import DurabilityPolicy, QoSProfile
from std_msgs.msg import String

from collision_monitor.alerts.rules import Rules
from collision_monitor.errors import InputError
from collision_monitor.pipeline import topics
from collision_monitor.pipeline.settings_event import RULES


class LiveRules:
    """Follows the parameter and the topic; a text on the topic becomes the value of the parameter.

    change: called with the rules that are in force from now on.
    """

    def __init__(self, node: Node, change: Callable[[Rules], None]) -> None:
        self._node, self._change = node, change
        node.add_on_set_parameters_callback(self._check)
        node.add_post_set_parameters_callback(self._apply)

    def subscribe(self) -> None:
        """Subscribe to the topic."""
        latched = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
        self._node.create_subscription(String, topics.RULES, self._on_text, latched)

    def _on_text(self, message: String) -> None:
        text = message.data if "\n" in message.data else f"{message.data}\n"  # never the path of a file
        (result,) = self._node.set_parameters([Parameter(RULES, value=text)])
        if not result.successful:
            self._node.get_logger().warning(f"{topics.RULES}: the rules stay as they are: {result.reason}")

    def _check(self, parameters: list[Parameter]) -> SetParametersResult:
        for each in parameters:
            if each.name == RULES:
                try:
                    Rules.given(str(each.value))
                except InputError as error:
                    return SetParametersResult(successful=False, reason=str(error))
        return SetParametersResult(successful=True)

    def _apply(self, parameters: list[Parameter]) -> None:
        for each in parameters:
            if each.name == RULES:
                self._change(Rules.given(str(each.value)))
