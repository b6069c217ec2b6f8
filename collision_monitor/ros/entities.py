"""The publishers, subscriptions and timers of one configuration of a node."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

from rclpy.lifecycle import LifecycleNode, LifecyclePublisher


class Entities:
    """What a node has at a time. `destroy_new` destroys everything that was made since then, by whichever part."""

    def __init__(self, node: LifecycleNode) -> None:
        self._node = node
        self._before = {each for each, _ in self._with_destroyers()}

    def _with_destroyers(self) -> Iterator[tuple[Any, Callable[[Any], bool]]]:
        node = self._node
        yield from ((each, node.destroy_timer) for each in node.timers)
        yield from ((each, node.destroy_subscription) for each in node.subscriptions)
        for each in node.publishers:
            is_managed = isinstance(each, LifecyclePublisher)
            yield each, node.destroy_lifecycle_publisher if is_managed else node.destroy_publisher

    def destroy_new(self) -> None:
        """Destroy the entities that were not there at first."""
        for each, destroy in list(self._with_destroyers()):
            if each not in self._before:
                destroy(each)
