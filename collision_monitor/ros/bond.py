"""The bond by which nav2's lifecycle manager notices that a node died, where `bondpy` is installed."""

from __future__ import annotations

from typing import Any, Final

from rclpy.node import Node

TOPIC: Final = "/bond"
HEARTBEAT_PERIOD: Final = 0.1
"""s, as nav2's own nodes have it."""

HEARTBEAT_TIMEOUT: Final = 4.0
"""s, the same."""


class ManagerBond:
    """The node's side of the bond, from `form` to `dissolve`. Without bondpy both do nothing."""

    def __init__(self, node: Node) -> None:
        self._node = node
        self._bond: Any = None

    def form(self) -> None:
        """Begin to send heartbeats, and log that the manager needs `bond_timeout: 0.0` if there can be none."""
        try:
            from bondpy.bondpy import Bond
        except ImportError:
            self._node.get_logger().info(
                "no bond, because bondpy is not installed: nav2's lifecycle manager needs bond_timeout: 0.0"
            )
            return
        self._bond = Bond(TOPIC, self._node.get_name(), node=self._node)
        self._bond.heartbeat_period = HEARTBEAT_PERIOD
        self._bond.heartbeat_timeout = HEARTBEAT_TIMEOUT
        self._bond.start()

    def dissolve(self) -> None:
        """End the bond on purpose, which the manager does not take for a death."""
        if self._bond is not None:
            self._bond.shutdown()
            self._bond = None
