"""The sources of a running node: topics of other programs, converted to the node's own inputs as they arrive.

A topic is subscribed when its publisher is there, with the publisher's quality of service and type. A line of the file
that cannot be used is logged with the reason and reported in `~/sources`; the others work.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from pathlib import Path
from typing import Any, Final

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from rclpy.logging import get_logging_directory
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy

from collision_monitor.errors import CollisionMonitorError, InputError, MessageError
from collision_monitor.pipeline.topics import Topic
from collision_monitor.ros.endpoints import message_class, publisher
from collision_monitor.ros.health.line_report import DiagnosticLevel, LineReport
from collision_monitor.ros.health.unmonitored_report import unmonitored_statuses
from collision_monitor.ros.monitor.large_messages import LargeMessages
from collision_monitor.ros.monitor.topic_subscriptions import TopicSubscriptions
from collision_monitor.ros.names import is_topic_name
from collision_monitor.session.mcap.definitions import definition
from collision_monitor.sources import Decoder, Feed, Input, Mapping, RawMessage, Unmonitored
from collision_monitor.sources.failures import FailureFiles
from collision_monitor.sources.feed import HORIZON
from collision_monitor.sources.messages.transform_arrays import TRANSFORMS
from collision_monitor.sources.robot.robot_preparation import RobotPreparation

AT_ONE_TIME: Final = 200
"""New objects of one message: 0.07 s until the monitor has them. The others follow with the next messages."""

GO_ON_PERIOD: Final = 0.02
"""s between two looks at what waits: further new objects, large messages that are decoded, robots that are made."""

SEARCH_PERIOD: Final = 0.2
"""s between two looks at the graph for topics of the file."""

REPORT_PERIOD: Final = 1.0
"""s between two messages on `~/sources`."""

REMINDER_PERIOD: Final = 10.0
"""s between two lines of the log about the same object, link or topic that is not monitored."""

_TF: Final = ("/tf", "/tf_static")


class LiveSources:
    """Subscribes to the topics of a sources file. take: called with each input for the monitor.

    warn: called with the name of a line, a text and how often it happened. horizon: s that the monitor looks ahead.
    Raises InputError for a topic whose name ROS does not accept.
    """

    def __init__(
        self,
        node: Node,
        mapping: Mapping,
        take: Callable[[Input], None],
        warn: Callable[[str, str, int], None],
        horizon: float = HORIZON,
    ) -> None:
        self._node, self._take, self._warn = node, take, warn
        self._mapping = mapping
        self._decoder = Decoder({})
        self._preparation = RobotPreparation()
        self._feed = Feed(
            mapping, self._decoder, allowance=AT_ONE_TIME, preparation=self._preparation, horizon=horizon
        )  # fmt: skip
        self._large = LargeMessages(self._decoder)
        self._subscriptions = TopicSubscriptions(node, self._on_message)
        self._failures = FailureFiles(Path(get_logging_directory()))
        # Transforms first: if several messages wait, the executor takes them in the order of the subscriptions.
        self._asked = self._feed.wanted  # the file names these topics; those of tf may be there besides
        wanted = dict.fromkeys(_TF, (TRANSFORMS,)) | self._asked
        for topic in (*wanted, *filter(None, [mapping.step_topic])):
            if not is_topic_name(topic):
                text = f"expected a topic's name of letters, digits, underscores and slashes, got {topic!r}"
                raise InputError(mapping.located(f"{self._line(topic)}, topic: {text}"))
        self._wanted = {node.resolve_topic_name(topic): (topic, types) for topic, types in wanted.items()}
        self._found: dict[str, str] = {}  # topic of the file -> type
        self._problems: dict[str, str] = {}  # the same, or the name of a line -> why it cannot be used
        self._messages: dict[str, int] = {}
        self._logged: dict[str, float] = {}  # when each row of what is not monitored was last logged, s
        self._out = publisher(node, Topic.SOURCES)
        node.create_timer(SEARCH_PERIOD, self._search)
        node.create_timer(REPORT_PERIOD, self._report)
        node.create_timer(GO_ON_PERIOD, self._go_on)

    def begin(self) -> None:
        """Describe what is known from the start, and look for the topics."""
        for each in self._feed.begin(self._now()):
            self._take(each)
        self._search()

    def close(self) -> None:
        """End the thread and the processes that prepare what takes long."""
        self._large.close()
        self._preparation.close()

    def look_ahead(self, horizon: float) -> None:
        """Plan robots for a new horizon (s) of the monitor."""
        self._feed.scene.horizon = horizon

    def set_pace(self, period: float) -> None:
        """Take no more than one step in `period` (s) of the stamps. States wait in the meantime, and newer ones win."""
        self._feed.least_period = period

    # -- topics

    def _search(self) -> None:
        """Subscribe to the topics that have a publisher by now."""
        for resolved in [name for name, (topic, _) in self._wanted.items() if topic not in self._found]:
            infos = self._node.get_publishers_info_by_topic(resolved)
            topic, types = self._wanted[resolved]
            if not infos and topic in self._asked:
                self._feed.miss_topic(topic, f"{topic} has no publisher", self._now())
            if infos:
                kinds = {info.topic_type for info in infos}
                try:
                    self._bind(topic, resolved, self._chosen(topic, kinds, types), infos)
                except CollisionMonitorError as error:
                    self._set_problem(topic, str(error))

    def _chosen(self, topic: str, kinds: set[str], types: tuple[str, ...]) -> str:
        usable = sorted(kinds & set(types))
        if not usable:
            expected = types[0] if len(types) == 1 else f"one of {', '.join(types)}"
            raise InputError(
                f"{self._line(topic)}: expected {topic} to carry {expected}, got {', '.join(sorted(kinds))}"
            )
        return usable[0]

    def _bind(self, topic: str, resolved: str, kind: str, infos: list[Any]) -> None:
        try:
            message_class(kind)
            self._decoder.define(kind, definition(kind))
        except (ImportError, AttributeError, CollisionMonitorError):
            package = kind.partition("/")[0]
            raise InputError(
                f"{self._line(topic)}: {topic} carries {kind}, and package {package} is not installed; "
                f"`make interfaces` builds it, or install ros-<distro>-{package.replace('_', '-')}"
            ) from None
        self._found[topic] = kind
        self._problems.pop(topic, None)
        if topic in self._asked:
            self._feed.miss_topic(topic, f"no message on {topic} yet", self._now())
        for name, text in self._feed.bind(topic, kind).items():
            self._set_problem(name, text)
        quality = self._subscriptions.add(topic, resolved, kind, infos)
        if quality.durability is DurabilityPolicy.TRANSIENT_LOCAL:
            self._feed.silence.latched.add(topic)
        self._node.get_logger().info(f"source {topic}: {kind}")

    def _look_again(self) -> None:
        """Hear all publishers of the topics, and list those of other types."""
        for topic, kinds in self._subscriptions.look_again():
            what = f"{topic}, another type"
            if kinds:
                text = f"{topic} carries {', '.join(kinds)} too, which is not taken beside {self._found[topic]}"
                self._feed.scene.unmonitored.lacks(self._line(topic), what, text, self._now())
            else:
                self._feed.scene.has(self._line(topic), what)

    def _line(self, topic: str) -> str:
        """Return the name of the first line of the file about a topic."""
        entries = self._mapping.topics.get(topic, ())
        return entries[0].name if entries else self._feed.owners.get(topic, topic)

    def _set_problem(self, key: str, text: str) -> None:
        if self._problems.get(key) != text:
            self._problems[key] = text
            if key in self._asked:
                self._feed.miss_topic(key, text, self._now())
            else:
                self._feed.scene.unmonitored.lacks(key, key, text, self._now())
            self._node.get_logger().error(self._mapping.located(text))

    # -- messages

    def _on_message(self, topic: str, kind: str, data: bytes) -> None:
        self._messages[topic] = self._messages.get(topic, 0) + 1
        raw = RawMessage(topic, kind, data, self._now())
        if not self._large.takes(raw):
            self._pass_on(self._feed.take(raw))
        elif not self._large.put(raw):
            self._pass_on(self._feed.take_decoded(raw, MessageError("too many large messages wait to be decoded")))
        self._go_on()

    def _go_on(self) -> None:
        """Take what a thread has decoded, and what was too much at once; one such piece at a time."""
        decoded = self._large.next()
        if decoded is not None:
            self._pass_on(self._feed.take_decoded(*decoded))
        elif self._feed.is_behind:
            self._pass_on(self._feed.go_on(self._now()))

    def _pass_on(self, inputs: list[Input]) -> None:
        """Give inputs to the monitor, and report what was refused on the way to them."""
        for each in inputs:
            self._take(each)
        for name, (count, text) in self._feed.scene.take_news().items():
            line = self._line(name)  # of a topic, whose message was refused as a whole
            what = f"{name}: {text}" if line == name else f"{line}: {name}: {text}"
            self._warn(name, self._mapping.located(what), count)
        for failure in self._feed.take_failures():
            path, is_new = self._failures.keep(failure)
            if is_new:
                kept = "it cannot be kept" if path is None else f"it is kept in {path}"
                text = f"{failure.line}: an unexpected error; its message was left out, and {kept}; please report both"
                self._node.get_logger().error(f"{self._mapping.located(text)}\n{failure.text}")

    def _now(self) -> int:
        return int(self._node.get_clock().now().nanoseconds)

    # -- report

    @property
    def unmonitored(self) -> tuple[Unmonitored, ...]:
        """What the file asks for and is not monitored now, the oldest first."""
        self._feed.listen(self._now())
        return self._feed.unmonitored

    def lines(self) -> list[LineReport]:
        """Return what each line of the file does, in the order of the file; then the topics that it implies."""
        named, owners = self._mapping.topics, self._feed.owners
        found = [self._line_report(each.name, each.topic) for each in self._mapping.sources if each.topic]
        others = [topic for topic, _ in self._wanted.values() if topic not in named]
        return found + [self._line_report(owners.get(topic, topic), topic) for topic in others]

    def _line_report(self, name: str, topic: str) -> LineReport:
        scene, messages = self._feed.scene, self._messages.get(topic, 0)
        keys = [name] if name == topic else [name, topic]  # what is refused as a whole counts for its topic
        refused = sum(scene.refused_by_name.get(key, 0) for key in keys)
        refusal = next((scene.last_refusal[key] for key in keys if key in scene.last_refusal), "")
        states = scene.line_states.get(name, 0)
        problem = self._problems.get(name) or self._problems.get(topic)
        if problem:
            level, text = DiagnosticLevel.ERROR, problem
        elif topic not in self._found:
            level, text = DiagnosticLevel.WARN if topic not in _TF else DiagnosticLevel.OK, f"{topic} has no publisher"
        elif not messages and topic not in _TF:
            level, text = DiagnosticLevel.WARN, f"no message on {topic} yet"
        else:
            level, text = (DiagnosticLevel.WARN, refusal) if refused else (DiagnosticLevel.OK, "ok")
        kind = self._found.get(topic, "")
        dropped = scene.points_dropped.get(name, 0)
        return LineReport(name, topic, kind, messages, states, refused, refusal, dropped, level, text)

    def _report(self) -> None:
        """Publish the state of each line of the file; log what is not monitored, each row at once and every 10 s."""
        self._look_again()
        now, logged = time.monotonic(), {}
        for row in self.unmonitored:
            key = f"{row.line} {row.what}"
            logged[key] = self._logged.get(key, -REMINDER_PERIOD)
            if now - logged[key] >= REMINDER_PERIOD:
                logged[key] = now
                self._warn(key, f"not monitored: {self._mapping.located(row.text)}", 1)
        self._logged = logged
        array = DiagnosticArray()
        array.header.stamp = self._node.get_clock().now().to_msg()
        for line in self.lines():
            values = {key: value for key, value in line._asdict().items() if key not in ("name", "level", "text")}
            pairs = [KeyValue(key=key, value=str(value)) for key, value in values.items()]
            topic = f" {line.topic}" if line.name in self._feed.owners.values() else ""  # a robot has several
            name = f"{self._node.get_name()}: {line.name}{topic}"
            array.status.append(
                DiagnosticStatus(
                    level=bytes([line.level]), name=name, message=line.text, hardware_id="none", values=pairs
                )
            )
        array.status += unmonitored_statuses(self._node.get_name(), self.unmonitored, self._now())
        self._out.publish(array)
