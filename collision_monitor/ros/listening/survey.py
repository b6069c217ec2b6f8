"""What is on the ROS graph right now: the topics that a sources file can use, with their frames and rates."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any, Final

import rclpy
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node

from collision_monitor.errors import CollisionMonitorError
from collision_monitor.pipeline.topics import Topic
from collision_monitor.ros.endpoints import message_class
from collision_monitor.ros.health.line_report import LineReport
from collision_monitor.ros.monitor.live_sources import LiveSources
from collision_monitor.ros.monitor.topic_subscriptions import quality_of_all
from collision_monitor.session.mcap.definitions import definition
from collision_monitor.sources import Decoder, Mapping
from collision_monitor.sources.ground.frames import frame_name
from collision_monitor.sources.kinds import BY_TYPE
from collision_monitor.sources.messages.marker_arrays import MarkerArrays
from collision_monitor.sources.messages.transform_arrays import TransformArrays
from collision_monitor.sources.robot.robot_template import is_of_robot

LOOK_PERIOD: Final = 0.2
"""s between two looks at the graph: DDS discovers publishers one after the other."""


@dataclass
class TopicFacts:
    """A topic and what its messages held. frames: of the headers. installed: whether this environment has the type."""

    topic: str
    type: str
    installed: bool = True
    messages: int = 0
    first: float = 0.0
    last: float = 0.0
    frames: set[str] = field(default_factory=set)
    parents: dict[str, str] = field(default_factory=dict)
    markers: set[str] = field(default_factory=set)

    @property
    def rate(self) -> float:
        """Messages per second (Hz); 0 if there are too few."""
        elapsed = self.last - self.first
        return (self.messages - 1) / elapsed if self.messages > 1 and elapsed > 0.0 else 0.0

    def add(self, content: Any) -> None:
        """Take over what a message holds."""
        now = time.monotonic()
        self.first, self.last, self.messages = self.first or now, now, self.messages + 1
        if isinstance(content, TransformArrays):
            self.parents |= dict(zip(map(frame_name, content.children), map(frame_name, content.parents), strict=True))
        elif isinstance(content, MarkerArrays):
            self.frames |= set(map(frame_name, content.frames))
            self.markers |= set(content.namespaces)
        elif hasattr(content, "header"):
            self.frames.add(frame_name(content.header.frame_id))


def survey(seconds: float) -> list[TopicFacts]:
    """Listen to every topic of a type that the sources understand, and return what was there, by topic.

    The markers of monitors are left out: they show what is monitored already.
    """
    found: dict[str, TopicFacts] = {}
    decoder = Decoder({})
    end = time.monotonic() + seconds
    with _Listener("collision_monitor_survey") as listener:
        while time.monotonic() < end:
            listener.listen(LOOK_PERIOD)
            topics = dict(listener.node.get_topic_names_and_types())
            for topic, kinds in topics.items():
                if _is_of_a_monitor(topic, topics):
                    continue
                kind = next((each for each in kinds if each in BY_TYPE or is_of_robot(topic, each)), None)
                if kind is not None and topic not in found:
                    _subscribe(listener.node, topic, kind, found, decoder)
    return [found[topic] for topic in sorted(found)]


def _is_of_a_monitor(topic: str, topics: dict[str, list[str]]) -> bool:
    """Whether a monitor publishes the topic, of all topics with their types, as its markers."""
    node = topic.removeprefix("/").removesuffix(f"/{Topic.MARKERS.path}")
    return topic == Topic.MARKERS.of(node) and Topic.STATUS.type_name in topics.get(Topic.STATUS.of(node), [])


def _subscribe(node: Node, topic: str, kind: str, found: dict[str, TopicFacts], decoder: Decoder) -> None:
    """Subscribe to a topic that has a publisher, if its type is installed."""
    infos = node.get_publishers_info_by_topic(topic)
    if not infos:
        return
    facts = found[topic] = TopicFacts(topic, kind)
    try:
        message = message_class(kind)
        decoder.define(kind, definition(kind))
    except (ImportError, AttributeError, CollisionMonitorError):
        facts.installed = False
        return
    node.create_subscription(message, topic, _noting(facts, decoder), quality_of_all(topic, infos), raw=True)


def _noting(facts: TopicFacts, decoder: Decoder) -> Callable[[bytes], None]:
    def note(data: bytes) -> None:
        try:
            facts.add(decoder(facts.type, data))
        except CollisionMonitorError:
            facts.messages += 1

    return note


def check(mapping: Mapping, seconds: float) -> tuple[list[LineReport], list[str]]:
    """Run the sources of a file without a monitor. Return what each of its lines did, and what is not monitored."""
    with _Listener("collision_monitor_check") as listener:
        sources = LiveSources(listener.node, mapping, lambda given: None, lambda name, text, count: None)
        sources.begin()
        listener.listen(seconds)
        sources.close()
        return sources.lines(), [mapping.located(row.text) for row in sources.unmonitored]


class _Listener:
    """A node that runs its callbacks for a time."""

    def __init__(self, name: str) -> None:
        self.node: Node = rclpy.create_node(name)
        self._executor = SingleThreadedExecutor()
        self._executor.add_node(self.node)

    def listen(self, seconds: float) -> None:
        end = time.monotonic() + seconds
        while (left := end - time.monotonic()) > 0.0:
            self._executor.spin_once(timeout_sec=left)

    def __enter__(self) -> _Listener:
        return self

    def __exit__(self, *_: object) -> None:
        self._executor.shutdown()
        self.node.destroy_node()
