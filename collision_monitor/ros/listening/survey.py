"""What is on the ROS graph right now: the topics that a sources file can use, with their frames and rates."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any, Final

import numpy as np
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
from collision_monitor.sources.feed import HORIZON
from collision_monitor.sources.ground.frames import frame_name
from collision_monitor.sources.kinds import BY_TYPE
from collision_monitor.sources.messages.marker_arrays import MarkerArrays
from collision_monitor.sources.messages.transform_arrays import TransformArrays
from collision_monitor.sources.robot.robot_template import is_of_robot

LOOK_PERIOD: Final = 0.2
"""s between two looks at the graph: DDS discovers publishers one after the other."""

QUIET: Final = 2.0
"""s without a new topic after which the graph is known."""

PATIENCE: Final = 3.0
"""s to wait for two messages of a topic: those of less than 1 Hz may be missed, and are listed without a rate."""

LONGEST: Final = 30.0
"""s after which a survey ends, also of a graph that never becomes quiet."""

MOST_MARKERS: Final = 20_000
"""Markers of a topic whose poses are remembered to see which of them move."""

MOVED: Final = 1e-3
"""Difference of two coordinates (m) or quaternions of a marker that moves."""


@dataclass
class TopicFacts:
    """A topic and what its messages held. frames: of the headers. installed: whether this environment has the type.

    since: when it was found (monotonic s). markers: their namespaces. moved: those of markers that moved meanwhile.
    """

    topic: str
    type: str
    since: float
    installed: bool = True
    messages: int = 0
    first: float = 0.0
    last: float = 0.0
    frames: set[str] = field(default_factory=set)
    parents: dict[str, str] = field(default_factory=dict)
    markers: set[str] = field(default_factory=set)
    moved: set[str] = field(default_factory=set)
    _poses: dict[tuple[str, int], Any] = field(default_factory=dict)

    def is_known(self, now: float) -> bool:
        """Whether enough messages came to know its rate, or it was waited for long enough."""
        return not self.installed or self.messages > 1 or now - self.since >= PATIENCE

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
            self._note_moves(content)
        elif hasattr(content, "header"):
            self.frames.add(frame_name(content.header.frame_id))

    def _note_moves(self, content: MarkerArrays) -> None:
        for namespace, rows in content.last.items():
            for number, row in rows.items():
                pose, key = content.poses[row], (namespace, number)
                before = self._poses.get(key)
                if before is not None and (np.abs(pose - before) > MOVED).any():
                    self.moved.add(namespace)
                if before is not None or len(self._poses) < MOST_MARKERS:
                    self._poses[key] = pose


def survey(seconds: float | None = None) -> list[TopicFacts]:
    """Listen to every topic of a type that the sources understand, and return what was there, by topic.

    seconds: for how long; None: until no new topic has come for QUIET and each was heard, LONGEST at most.
    The markers of monitors are left out: they show what is monitored already.
    """
    found: dict[str, TopicFacts] = {}
    decoder = Decoder({})
    began = changed = time.monotonic()
    known: list[tuple[str, list[str]]] = []

    def is_over() -> bool:
        now = time.monotonic()
        if seconds is not None:
            return now - began >= seconds
        is_quiet = now - changed >= QUIET and all(each.is_known(now) for each in found.values())
        return is_quiet or now - began >= LONGEST

    with _Listener("collision_monitor_survey") as listener:
        while not is_over():
            listener.listen(LOOK_PERIOD)
            names = listener.node.get_topic_names_and_types()
            changed, known = (changed, known) if names == known else (time.monotonic(), names)
            topics = dict(names)
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
    facts = found[topic] = TopicFacts(topic, kind, time.monotonic())
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
        sources = LiveSources(listener.node, mapping, lambda given: None, lambda name, text, count: None, HORIZON)
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
