"""A subscriber to any one topic, which writes its messages as YAML, and the list of all topics."""

from __future__ import annotations

import array
import difflib
import time
from collections import deque
from typing import Any, Final

import numpy as np
import rclpy
import yaml
from rclpy.executors import SingleThreadedExecutor

from collision_monitor.errors import CollisionMonitorError
from collision_monitor.ros.endpoints import message_class
from collision_monitor.ros.monitor.topic_subscriptions import quality_of_all
from collision_monitor.ros.names import is_topic_name
from collision_monitor.ros.process import StopRequest

QUIET: Final = 1.0
"""Time without a new topic (s) after which the graph is known: DDS discovers one participant after the other."""

MOST_SECONDS: Final = 10.0
"""Longest time to wait for the graph to be quiet (s)."""

MOST_WAITING: Final = 100
"""Messages that wait to be printed; older ones are dropped."""


class TopicListener:
    """A node that listens to one topic. Use it in a `with` block."""

    def __init__(self) -> None:
        self._node = rclpy.create_node("collision_monitor_echo")
        self._executor = SingleThreadedExecutor()
        self._executor.add_node(self._node)
        self._texts: deque[str] = deque(maxlen=MOST_WAITING)

    def topics(self) -> list[tuple[str, list[str]]]:
        """All topics with their types, once no new one has come for QUIET."""
        began = changed = time.monotonic()
        known: list[tuple[str, list[str]]] = []
        while (now := time.monotonic()) - changed < QUIET and now - began < MOST_SECONDS:
            found = self._node.get_topic_names_and_types()
            changed, known = (changed, known) if found == known else (now, found)
            self._executor.spin_once(timeout_sec=0.05)
        return sorted(known)

    def subscribe(self, topic: str, elements: int, until: float, stop: StopRequest) -> None:
        """Subscribe to a topic once somebody publishes it.

        Raises CollisionMonitorError if nobody does until then (monotonic s), and for a type that is not installed.
        """
        if not is_topic_name(topic):
            raise CollisionMonitorError(f"expected the name of a topic, got {topic!r}")
        while not (infos := self._node.get_publishers_info_by_topic(topic)) and not stop.received:
            if time.monotonic() >= until:
                names = [name for name, _ in self._node.get_topic_names_and_types()]
                alike = difflib.get_close_matches(topic, names, n=3, cutoff=0.4)
                hint = f"; there are {', '.join(alike)}" if alike else "; `echo --list` lists the topics"
                raise CollisionMonitorError(f"expected a publisher of {topic}, got none{hint}")
            self._executor.spin_once(timeout_sec=0.05)
        if not infos:
            return
        kind = infos[0].topic_type
        try:
            message = message_class(kind)
        except (ImportError, AttributeError):
            raise CollisionMonitorError(
                f"{topic}: expected an installed message package, got {kind}; `make interfaces` builds those that the "
                "sources read"
            ) from None

        def keep(given: Any) -> None:
            self._texts.append(message_text(given, elements))

        self._node.create_subscription(message, topic, keep, quality_of_all(topic, infos))

    def texts(self, seconds: float) -> list[str]:
        """Messages that came within so many seconds, as YAML."""
        end = time.monotonic() + seconds
        while not self._texts and (left := end - time.monotonic()) > 0.0:
            self._executor.spin_once(timeout_sec=left)
        found = list(self._texts)
        self._texts.clear()
        return found

    def __enter__(self) -> TopicListener:
        return self

    def __exit__(self, *_: object) -> None:
        self._executor.shutdown()
        self._node.destroy_node()


def message_text(message: Any, elements: int) -> str:
    """A message as YAML. Of an array, at most so many elements are there, and a text that says how many there are."""
    return str(yaml.safe_dump(_plain(message, elements), sort_keys=False, allow_unicode=True, default_flow_style=None))


def _plain(value: Any, elements: int) -> Any:
    """A message, an array or a value as what YAML knows."""
    if hasattr(value, "get_fields_and_field_types"):
        return {name: _plain(getattr(value, name), elements) for name in value.get_fields_and_field_types()}
    if isinstance(value, bytes):
        return value[0] if len(value) == 1 else value.hex()
    if isinstance(value, np.ndarray | list | tuple | array.array):
        shown = [_plain(each, elements) for each in value[:elements]]
        return [*shown, f"… {len(value)} in all"] if len(value) > elements else shown
    return value.item() if isinstance(value, np.generic) else value
