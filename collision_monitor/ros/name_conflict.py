"""Notices another node of the same name, whose answers would mix with ours on the same topics."""

from __future__ import annotations

from rclpy.node import Node


class NameConflict:
    """Looks for nodes of the same full name and logs when one appears and when it has gone.

    others: number of such nodes at the last look.
    """

    def __init__(self, node: Node) -> None:
        self._node = node
        self._name = node.get_fully_qualified_name()
        self.others = 0

    def look(self) -> None:
        """Compare the names that the middleware knows with ours. Log a change."""
        own = (self._node.get_name(), self._node.get_namespace())
        others = max(0, self._node.get_node_names_and_namespaces().count(own) - 1)
        if others and not self.others:
            self._node.get_logger().warning(
                f"another node has the name {self._name}: both publish on the same topics, and a subscriber cannot "
                "tell their answers apart; end one of them or remap its name (--ros-args -r __node:=other)"
            )
        elif self.others and not others:
            self._node.get_logger().info(f"no other node has the name {self._name} any more")
        self.others = others
