"""Messages of other programs in, messages for the monitor out: the one path of the live node and of bags.

The same messages in the same order give the same bytes. Time is that of the stamps, and no clock is read.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from typing import Any, Final, NamedTuple

import numpy as np

from collision_monitor.codec import Change, encode_descriptions, encode_states
from collision_monitor.errors import InputError, MessageError
from collision_monitor.monitor.state.timeline import Order, Progress, Timeline
from collision_monitor.pipeline.topics import Topic
from collision_monitor.sources.ground.frames import frame_name
from collision_monitor.sources.ground.mapping import HEADER, Mapping
from collision_monitor.sources.ground.object_entry import ObjectEntry
from collision_monitor.sources.ground.source import RawMessage, Source
from collision_monitor.sources.ground.source_scene import SourceScene
from collision_monitor.sources.ground.unmonitored import Unmonitored
from collision_monitor.sources.ground.waiting_states import Step
from collision_monitor.sources.kinds import BY_TYPE, SECTIONS
from collision_monitor.sources.messages.static_objects import StandingObjects
from collision_monitor.sources.messages.tf_objects import TRANSFORMS, FrameSource
from collision_monitor.sources.robot.robot_source import RobotSource

MAX_TIME_STEP: Final = 10.0
"""s by which a stamp may jump; a larger jump needs a second message, as in the monitor."""

PATIENCE: Final = 0.5
"""s that a publisher with earlier stamps must go on before its time counts."""

STATIC: Final = "tf_static"

Decode = Callable[[str, bytes], Any]
"""Decodes a message of a type. Raises MessageError."""


class Input(NamedTuple):
    """A message for the monitor. topic: STATES or SHAPES. Times in ns."""

    topic: Topic
    data: bytes
    log_time: int
    publish_time: int


class Feed:
    """Converts messages, one by one. scene: what is known, and what was refused. owners: lines of sections by topic.

    least_period: s between two steps at a rate or with a topic. States that arrive in the meantime wait for the next.
    Call `bind` for each topic when its type is known, `begin` once, and `take` for each message. Raises InputError for
    a file that cannot be used.
    """

    def __init__(self, mapping: Mapping, decode: Decode) -> None:
        self.mapping = mapping
        self.scene = SourceScene(
            mapping.frame,
            mapping.max_age,
            first_free_id=1 + max((entry.object_id for entry in mapping.sources), default=0),
            by_header=mapping.stamps == HEADER,
        )
        self._decode = decode
        self._timeline = Timeline()
        self._last_stamps: dict[str, int] = {}
        self._tick: int | None = None  # the number of the last step at a rate
        self._last_step: int | None = None  # its stamp, or that of the last one with a topic
        self.least_period = 0.0
        self._standing = StandingObjects([entry for entry in mapping.sources if entry.static and not entry.topic])
        self._sources: list[Source] = [self._standing]
        self._by_topic: dict[str, list[Source]] = {}
        self.owners: dict[str, str] = {}
        for name, content in mapping.sections.items():
            for source in SECTIONS[name](content, mapping):
                self._add(source, source.topics)
                self.owners.update(dict.fromkeys(source.topics, getattr(source, "name", name)))

    # -- topics

    @property
    def wanted(self) -> dict[str, tuple[str, ...]]:
        """The topics of the file with the types that each may carry."""
        found: dict[str, tuple[str, ...]] = {}
        for topic, entries in self.mapping.topics.items():
            found[topic] = tuple({entry.type: None for entry in entries if entry.type}) or tuple(BY_TYPE)
        for source in self._sources:
            found.update(source.topics)
        return found

    def bind(self, topic: str, message_type: str) -> dict[str, str]:
        """Make the sources of a topic of `objects:`. Return the reason for each entry that does not fit the type."""
        problems = {}
        for entry in self.mapping.topics.get(topic, ()):
            try:
                self._add(self._source(entry, message_type), [topic])
            except InputError as error:
                problems[entry.name] = str(error)
        return problems

    def _source(self, entry: ObjectEntry, message_type: str) -> Source:
        if entry.type and entry.type != message_type:
            raise InputError(f"{entry.name}, type: expected {entry.topic} to carry {entry.type}, got {message_type}")
        if message_type not in BY_TYPE:
            known = ", ".join(BY_TYPE)
            raise InputError(f"{entry.name}: expected {entry.topic} to be one of {known}, got {message_type}")
        return BY_TYPE[message_type](entry, message_type, self.mapping)

    def _add(self, source: Source, topics: Iterable[str]) -> None:
        self._sources.append(source)
        for topic in topics:
            self._by_topic.setdefault(topic, []).append(source)

    def lines_of(self, topic: str) -> list[str]:
        """Return the lines of the file that use a topic; the topic itself if the file only implies it."""
        return [entry.name for entry in self.mapping.topics.get(topic, ())] or [self.owners.get(topic, topic)]

    def miss_topic(self, topic: str, reason: str, now_ns: int) -> None:
        """Note why nothing of a topic is monitored: no publisher, another type. A message ends that."""
        for line in self.lines_of(topic):
            self.scene.unmonitored.lacks(line, topic, reason, now_ns)

    @property
    def unmonitored(self) -> tuple[Unmonitored, ...]:
        """What the file asks for and is not monitored now, the oldest first."""
        return self.scene.unmonitored.rows()

    @property
    def misplaced(self) -> list[str]:
        """Static objects in frames that tf has not connected with the monitor's so far, with the reason."""
        return self._standing.misplaced(self.scene)

    # -- messages

    def begin(self, received: int) -> list[Input]:
        """Return the descriptions of what is known from the start, as a snapshot."""
        self.scene.received_ns = received
        for topic in self.wanted:
            self.miss_topic(topic, f"no message on {topic} yet", received)
        for entry in self.mapping.sources:
            if entry.shapes and not entry.static and entry.marker is None:
                self.scene.describe(entry.describe())
                self.scene.states[entry.name] = 0
            elif entry.marker is not None and entry.marker[1] is not None:
                self.scene.states[entry.name] = 0
        for source in self._sources:
            source.begin(self.scene)
        changes = sorted(self.scene.take_changes(), key=lambda change: change.object_id)
        return [self._descriptions(changes, received, snapshot=True)]

    def take(self, raw: RawMessage) -> list[Input]:
        """Return the inputs that a message becomes."""
        self.scene.received_ns = raw.received
        for line in self.lines_of(raw.topic):
            self.scene.has(line, raw.topic)
        try:
            content = self._decode(raw.type, raw.data)
        except MessageError as error:
            self.scene.refuse(raw.topic, str(error))
            return []
        if raw.type == TRANSFORMS:
            return list(self._take_transforms(raw, content))
        return list(self._take(raw, content, self._by_topic.get(raw.topic, [])))

    def _take_transforms(self, raw: RawMessage, content: Any) -> Iterator[Input]:
        scene, static = self.scene, raw.topic.endswith(STATIC)
        for each in content.transforms:
            p, q = each.transform.translation, each.transform.rotation
            reason = scene.frames.put(
                frame_name(each.header.frame_id),
                frame_name(each.child_frame_id),
                np.array([p.x, p.y, p.z]),
                np.array([q.x, q.y, q.z, q.w]),
                scene.stamp_of(each.header, raw.received),
                static=static,
            )
            if reason is not None:
                scene.refuse(raw.topic, reason)
        if static:
            self._standing.settle(0, scene)
        moved: dict[int, list[Source]] = {}
        for source in self._by_topic.get(raw.topic, ()):
            if not isinstance(source, FrameSource | RobotSource):
                continue
            if (header := source.moved_by(content, scene)) is not None:
                moved.setdefault(scene.stamp_of(header, raw.received), []).append(source)
        for stamp in sorted(moved):
            yield from self._step(raw, content, moved[stamp], stamp)
        if not moved:
            yield from self._changes(raw.received)

    def _take(self, raw: RawMessage, content: Any, sources: list[Source]) -> Iterator[Input]:
        header = getattr(content, "header", None)
        if header is None:  # a MarkerArray
            header = next((each.header for each in getattr(content, "markers", ())), None)
        if header is not None:
            yield from self._step(raw, content, sources, self.scene.stamp_of(header, raw.received))
            return
        now = self._timeline.now_ns if self._timeline.has_begun else raw.received
        for source in sources:  # a message without a stamp, such as a URDF, makes no step
            source.take(raw.topic, content, now, self.scene)
        yield from self._changes(raw.received)

    def _step(self, raw: RawMessage, content: Any, sources: list[Source], stamp: int) -> Iterator[Input]:
        """Give a message to its sources, and yield the inputs that are due with it."""
        progress = self._advance(raw.topic, stamp)
        if progress is Progress.RESTARTS:
            self.scene.restart()
            self._tick = self._last_step = None
        elif progress is Progress.REFUSED and self._has_own_steps:
            self.scene.refuse(
                raw.topic,
                f"stamp: expected one within {MAX_TIME_STEP:g} s of the others, got one further away: another clock, "
                "or a jump that the next message confirms",
            )
            return
        for source in sources:
            source.take(raw.topic, content, stamp, self.scene)
        at = self._step_time(raw.topic, stamp)
        if at is not None:
            for source in self._sources:
                source.settle(at, self.scene)
        yield from self._changes(raw.received)
        if at is not None:
            yield from (self._states(step, raw.received) for step in self._due(at))

    def _advance(self, topic: str, stamp: int) -> Progress:
        order = Order.OLD if stamp < self._last_stamps.get(topic, stamp) else Order.IN_ORDER
        self._last_stamps[topic] = stamp
        return self._timeline.advance(stamp, order, MAX_TIME_STEP, PATIENCE)

    # -- steps

    @property
    def _has_own_steps(self) -> bool:
        return bool(self.mapping.rate or self.mapping.step_topic)

    def _step_time(self, topic: str, stamp: int) -> int | None:
        """Return the stamp of the step that is due with a message; None if there is none."""
        if not self._has_own_steps:
            return self._timeline.now_ns
        if self.mapping.step_topic:
            return stamp if topic == self.mapping.step_topic and not self._is_too_soon(stamp) else None
        period = round(1e9 / self.mapping.rate)
        tick = self._timeline.now_ns // period
        if (self._tick is not None and tick <= self._tick) or self._is_too_soon(tick * period):
            return None
        self._tick = tick
        return tick * period

    def _is_too_soon(self, stamp: int) -> bool:
        """Whether the least period after the last step is not over. If it is, this step is the last one."""
        if self._last_step is not None and 0 <= stamp - self._last_step < self.least_period * 1e9:
            return True
        self._last_step = stamp
        return False

    def _due(self, at: int) -> Iterator[Step]:
        waiting = self.scene.waiting
        if not self._has_own_steps:
            yield from waiting.as_stamped()
            return
        yield waiting.at(at)
        for object_id in waiting.too_old:
            self.scene.refuse_old(object_id)

    def _changes(self, received: int) -> Iterator[Input]:
        if changes := self.scene.take_changes():
            yield self._descriptions(changes, received)

    def _descriptions(self, changes: list[Change], received: int, *, snapshot: bool = False) -> Input:
        stamp = self._timeline.now_ns if self._timeline.has_begun else 0
        data = encode_descriptions(stamp, self.mapping.frame, changes, snapshot=snapshot)
        return Input(Topic.SHAPES, data, received, received)

    def _states(self, step: Step, received: int) -> Input:
        covariance = None if step.covariance is None else step.covariance.ravel()
        data = encode_states(step.stamp_ns, self.mapping.frame, 0, step.states, covariance)
        return Input(Topic.STATES, data, received, step.stamp_ns)
