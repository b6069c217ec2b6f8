"""Messages of other programs in, messages for the monitor out: the one path of the live node and of bags.

The same messages in the same order give the same bytes. Time is that of the stamps, and no clock is read.
"""

from __future__ import annotations

from collections.abc import Callable, Hashable, Iterable, Iterator
from functools import cached_property
from typing import Any, Final, NamedTuple

import numpy as np

from collision_monitor import records
from collision_monitor.codec import Change, encode_descriptions, encode_states, encode_trajectories
from collision_monitor.errors import InputError, MessageError
from collision_monitor.monitor.state.timeline import Progress
from collision_monitor.pipeline.topics import Topic
from collision_monitor.sources.failures import MOST_KEPT_FAILURES, SourceFailure, source_failure
from collision_monitor.sources.ground.frames import LONGEST_FRAME_NAME, checked_poses, frame_name
from collision_monitor.sources.ground.given_stamps import given_stamp, stream_of
from collision_monitor.sources.ground.mapping import HEADER, Mapping
from collision_monitor.sources.ground.object_entry import ObjectEntry
from collision_monitor.sources.ground.silent_topics import SilentTopics
from collision_monitor.sources.ground.source import RawMessage, Source
from collision_monitor.sources.ground.source_scene import SourceScene
from collision_monitor.sources.ground.source_time import MAX_TIME_STEP, MessageStamp, SourceTime
from collision_monitor.sources.ground.unmonitored import Unmonitored
from collision_monitor.sources.ground.waiting_states import Step
from collision_monitor.sources.kinds import BY_TYPE, beside_topics
from collision_monitor.sources.messages.grids import UPDATES
from collision_monitor.sources.messages.static_objects import StandingObjects
from collision_monitor.sources.messages.tf_objects import FrameSource
from collision_monitor.sources.messages.transform_arrays import TRANSFORMS, TransformArrays
from collision_monitor.sources.robot.robot_preparation import RobotPreparation
from collision_monitor.sources.robot.robot_source import RobotSource

STATIC: Final = "tf_static"

LISTEN_PERIOD: Final = 100_000_000
"""ns of the clock of receipt between two looks at topics that may have fallen silent."""

HORIZON: Final = 2.0
"""s that a monitor looks ahead by default."""

MOST_TRANSFORMS: Final = 10_000
"""Transforms of a message, 0.1 s. A robot sends 100."""

MOST_BRIDGED: Final = 100
"""Steps without states in a silence of all topics, one each MAX_TIME_STEP, 0.1 s."""

_LONGEST_STEP: Final = round(MAX_TIME_STEP * 1e9)

_JUMP: Final = (
    f"stamp: expected one within {MAX_TIME_STEP:g} s of the others, got one further away: another clock, "
    "or a jump that the next message confirms"
)

Decode = Callable[[str, bytes], Any]
"""Decodes a message of a type. Raises MessageError."""


class Input(NamedTuple):
    """A message for the monitor. topic: STATES, SHAPES or TRAJECTORIES. Times in ns."""

    topic: Topic
    data: bytes
    log_time: int
    publish_time: int


class Feed:
    """Converts messages, one by one. scene: what is known, and what was refused. owners: lines of sections by topic.

    allowance: objects that one message may describe anew; None: any number. The others wait for the next message, or
    for `go_on`. preparation: makes robots that take long; None: they are made at once. Call `bind` for each topic when
    its type is known, `begin` once, and `take` for each message. Raises InputError for a file that cannot be used.
    """

    def __init__(
        self,
        mapping: Mapping,
        decode: Decode,
        *,
        allowance: int | None = None,
        preparation: RobotPreparation | None = None,
        horizon: float = HORIZON,
    ) -> None:
        self.mapping = mapping
        self._time = SourceTime(
            by_header=mapping.stamps == HEADER,
            rate=mapping.rate,
            step_topic=mapping.step_topic,
            max_age=mapping.max_age,
        )
        ids = {entry.object_id for entry in mapping.sources}
        self.scene = SourceScene(mapping.frame, mapping.max_age, self._time, ids)
        self.scene.preparation = preparation
        self.scene.horizon = horizon
        self._decode = decode
        self._allowance = allowance
        self._failures: list[SourceFailure] = []
        self._asked: frozenset[str] = frozenset()
        self._listened = 0
        self._stepped: int | None = None  # stamp of the last step, ns; None before the first one of this time
        stale = [entry.name for entry in mapping.sources if entry.static or entry.shapes]
        self.silence = SilentTopics(mapping.max_age, stale)
        self._standing = StandingObjects([entry for entry in mapping.sources if entry.static and not entry.topic])
        self._sources: list[Source] = [self._standing]
        self._by_topic: dict[str, list[Source]] = {}
        self._types: dict[str, dict[str, None]] = {}  # by topic, those that its sources take
        self.owners: dict[str, str] = {}
        for source in beside_topics(mapping):
            self._add(source, source.topics)
            self.owners.update(dict.fromkeys(source.topics, source.name))

    @property
    def least_period(self) -> float:
        """s between two steps at a rate or with a topic. States that arrive in the meantime wait for the next."""
        return self._time.least_period

    @least_period.setter
    def least_period(self, period: float) -> None:
        self._time.least_period = period

    # -- topics

    @property
    def wanted(self) -> dict[str, tuple[str, ...]]:
        """The topics of the file with the types that each may carry."""
        found: dict[str, tuple[str, ...]] = {}
        for topic, entries in self.mapping.topics.items():
            found[topic] = tuple({entry.type: None for entry in entries if entry.type}) or tuple(BY_TYPE)
            found.update({entry.updates: tuple(UPDATES.values()) for entry in entries if entry.updates})
        return found | {topic: types for source in self._sources for topic, types in source.topics.items()}

    def bind(self, topic: str, message_type: str) -> dict[str, str]:
        """Make the sources of a topic of `objects:`. Return the reason for each entry that does not fit the type."""
        problems = {}
        for entry in self.mapping.topics.get(topic, ()):
            try:
                source = self._source(entry, message_type)
                self._add(source, source.topics)
                self.owners.update(dict.fromkeys(source.topics.keys() - self._lines.keys(), entry.name))
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
            self._types.setdefault(topic, {}).update(dict.fromkeys(source.topics.get(topic, ())))

    @cached_property
    def _lines(self) -> dict[str, list[str]]:
        return {topic: [entry.name for entry in entries] for topic, entries in self.mapping.topics.items()}

    def lines_of(self, topic: str) -> list[str]:
        """Return the lines of the file that use a topic; the topic itself if the file only implies it."""
        return self._lines.get(topic) or [self.owners.get(topic, topic)]

    def miss_topic(self, topic: str, reason: str, now_ns: int) -> None:
        """Note why nothing of a topic is monitored: no publisher, another type. A message ends that."""
        is_optional = topic in {entry.updates for entry in self.mapping.sources}
        if is_optional or not all(each.awaited for each in self._by_topic.get(topic, ())):
            return
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
        wanted = self.wanted
        self._asked = frozenset(wanted)
        for topic in wanted:
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
        """Return the inputs that a message becomes. Nothing is raised: what is wrong is refused, and counted."""
        try:
            content = self._decode(raw.type, raw.data)
        except Exception as error:  # refused like what the sources raise
            content = error
        return self.take_decoded(raw, content)

    def take_decoded(self, raw: RawMessage, content: Any) -> list[Input]:
        """Return the inputs that a message becomes. content: as decoded, or the exception that the decoder raised."""
        found: list[Input] = []
        self._prepare(raw.received)
        content = self._of_type(raw, content)
        with np.errstate(all="ignore"), self.scene.guard(raw.topic):  # numbers that are none: the monitor refuses them
            if isinstance(content, Exception):
                raise content
            for each in self._inputs(raw, content):
                found.append(each)
        if isinstance(content, Exception):
            self._miss(raw)
        self._listen(raw.received)
        self._keep_errors(raw)
        return found

    def go_on(self, received: int) -> list[Input]:
        """Return the inputs of what still waits: objects beyond the allowance of the messages before."""
        found: list[Input] = []
        self._prepare(received)
        with np.errstate(all="ignore"), self.scene.guard("sources"):
            self._settle(self._time.now_or(received))
            found += self._changes(received)
        self._listen(received)
        self._keep_errors(RawMessage("", "", b"", received))
        return found

    @property
    def is_behind(self) -> bool:
        """Whether something waits for `go_on`."""
        return self.scene.is_behind or (self.scene.preparation is not None and self.scene.preparation.is_busy)

    def take_failures(self) -> list[SourceFailure]:
        """Return the errors since the last call that nobody expected, with their messages."""
        failures, self._failures = self._failures, []
        return failures

    def _prepare(self, received: int) -> None:
        self.scene.received_ns = received
        self.scene.allowance = self._allowance
        self.scene.is_behind = False

    def _keep_errors(self, raw: RawMessage) -> None:
        for name, error in self.scene.take_errors():
            if len(self._failures) < MOST_KEPT_FAILURES:
                self._failures.append(source_failure(name, error, raw))

    def _miss(self, raw: RawMessage) -> None:
        """List the lines whose message was refused as a whole."""
        if raw.topic in self._asked:
            self.miss_topic(raw.topic, self.scene.last_refusal.get(raw.topic, "its message was refused"), raw.received)

    def _listen(self, received: int) -> None:
        """List the lines whose topics fell silent, at most ten times a second."""
        if 0 <= received - self._listened < LISTEN_PERIOD:
            return
        self._listened = received
        self.listen(received)

    def listen(self, now_ns: int) -> None:
        """List the lines whose topics are silent by now."""
        for each in self.silence.find(now_ns):
            self.scene.unmonitored.lacks(each.line, each.topic, each.reason, each.last_ns)

    def _of_type(self, raw: RawMessage, content: Any) -> Any:
        """Return the content; a MessageError in place of that of a type that no source of the topic takes."""
        expected = self._types.get(raw.topic)
        if not expected or raw.type in expected:
            return content
        return MessageError(f"expected {' or '.join(expected)}, got {raw.type:.80}")

    def _inputs(self, raw: RawMessage, content: Any) -> Iterator[Input]:
        if raw.type == TRANSFORMS:
            return self._take_transforms(raw, content)
        return self._take(raw, content, self._by_topic.get(raw.topic, []))

    def _take_transforms(self, raw: RawMessage, content: TransformArrays) -> Iterator[Input]:
        scene, static = self.scene, raw.topic.endswith(STATIC)
        stamps: dict[str, MessageStamp] = {}  # of the frames in this message
        own: dict[int, MessageStamp] = {}  # most transforms of a message have the same one
        poses = checked_poses(content.poses[:MOST_TRANSFORMS])
        if (more := len(content.children) - MOST_TRANSFORMS) > 0:
            scene.refuse(raw.topic, f"expected at most {MOST_TRANSFORMS} transforms in a message, got more", more)
        given_stamps = content.stamps[:MOST_TRANSFORMS]
        # the newest first, so that of several stamps in one late message none confirms another
        for k in sorted(range(len(given_stamps)), key=lambda k: -given_stamps[k]):
            name = content.children[k]
            with scene.guard(raw.topic, name):
                child, parent, given = frame_name(name), frame_name(content.parents[k]), content.stamps[k]
                stamp = own.get(given) or self._time.message_stamp(given, raw.received)
                if stamp.is_own:
                    own[given] = stamp
                if not static and stamp.is_own and not self._takes_transform(child, stamp.ns, raw):
                    continue
                reason = scene.frames.put_checked(parent, child, poses[k], stamp.ns, static=static)
                if reason is None:
                    stamps[child] = stamp
                else:
                    scene.refuse(raw.topic, reason)
        if static:
            self._standing.settle(0, scene)
        moved: dict[tuple[MessageStamp, str], list[Source]] = {}
        for source in self._by_topic.get(raw.topic, ()):
            if not isinstance(source, FrameSource | RobotSource):
                continue
            frame = source.moved_by(scene)
            if frame in stamps:
                moved.setdefault((stamps[frame], frame), []).append(source)
            elif frame is None:
                text = f"no moving transform to {source.frame!r}; frames known from tf: {scene.frames.some_names}"
                scene.unmonitored.explain(source.name, raw.topic, text)
        taken = [each for each in sorted(moved, reverse=True) if self._advances(raw, ("/tf", each[1]), each[0])]
        for stamp, frame in reversed(taken):
            yield from self._step(raw, content, moved[stamp, frame], stamp)
        if not moved:
            yield from self._changes(raw.received)

    def _takes_transform(self, frame: str, stamp: int, raw: RawMessage) -> bool:
        """Whether the stamp of a transform can be used; False after a refusal."""
        progress = self._time.advance_transforms(frame[:LONGEST_FRAME_NAME], stamp, raw.received)
        if progress is Progress.RESTARTS:
            self._restart(stamp)
        elif progress is Progress.REFUSED:
            self.scene.refuse(raw.topic, f"{frame:.80}: {_JUMP}")
        return progress is not Progress.REFUSED

    def _take(self, raw: RawMessage, content: Any, sources: list[Source]) -> Iterator[Input]:
        given = given_stamp(content)
        if given is not None:
            stamp = self._time.message_stamp(given, raw.received)
            if self._advances(raw, stream_of(raw.topic, content), stamp):
                yield from self._step(raw, content, sources, stamp)
            return
        self._give(raw.topic, content, sources, self._time.now_or(raw.received))
        yield from self._changes(raw.received)  # a message without a stamp, such as a URDF, makes no step

    def _advances(self, raw: RawMessage, stream: Hashable, stamp: MessageStamp) -> bool:
        """Whether the time goes on, or begins anew, with a stamp of a message; False after a refusal."""
        progress = self._time.advance(stream, stamp, raw.received)
        if progress is Progress.RESTARTS:
            self._restart(stamp.ns)
        elif progress is Progress.REFUSED:
            self.scene.refuse(raw.topic, _JUMP)
            self._miss(raw)
        return progress is not Progress.REFUSED

    def _step(self, raw: RawMessage, content: Any, sources: list[Source], stamp: MessageStamp) -> Iterator[Input]:
        """Give a message to its sources, and yield the inputs that are due with it."""
        self._give(raw.topic, content, sources, stamp.ns)
        at = self._time.step_due(raw.topic, stamp.ns)
        if at is not None:
            if len(self._silence_until(at)) > MOST_BRIDGED:
                for source in self._sources:
                    source.forget_plans()
            self._settle(at)
        yield from self._changes(raw.received)
        if at is not None:
            yield from self._plans(raw.received)
            for step in self._due(at):
                yield from (self._states(each, raw.received) for each in (*self._bridge(step.stamp_ns), step))

    def _give(self, topic: str, content: Any, sources: list[Source], stamp: int) -> None:
        """Let each source take a message. A line that it leaves without anything of use is listed as not monitored."""
        scene = self.scene
        for source in sources:
            name = source.name
            refused, states = scene.refused_by_name[name], scene.line_states[name]
            with scene.guard(name):
                source.take(topic, content, stamp, scene)
            if source.speaks:
                self.silence.heard(topic, name, scene.received_ns)
            if source.speaks and scene.refused_by_name[name] > refused and scene.line_states[name] == states:
                scene.lacks(name, topic, scene.last_refusal[name])
            else:
                scene.has(name, topic)

    def _settle(self, at: int) -> None:
        for source in self._sources:
            with self.scene.guard(source.name):
                source.settle(at, self.scene)

    def _restart(self, stamp: int) -> None:
        """Let everything that holds a stamp begin anew."""
        self._stepped = None
        self.scene.restart()
        for source in self._sources:
            with self.scene.guard(source.name):
                source.restart(stamp, self.scene)

    # -- inputs

    def _due(self, at: int) -> Iterator[Step]:
        waiting = self.scene.waiting
        if not self._time.has_own_steps:
            yield from waiting.as_stamped()
            return
        yield waiting.at(at)
        for object_id in waiting.too_old:
            self.scene.refuse_old(object_id)

    def _bridge(self, stamp: int) -> Iterator[Step]:
        """Yield steps without states up to one after a long silence, whose stamp the monitor would take for a jump.

        A silence that is longer than MOST_BRIDGED steps is one: the monitor begins anew behind it.
        """
        between, last = self._silence_until(stamp), self._stepped
        self._stepped = stamp if last is None else max(last, stamp)
        for each in between if len(between) <= MOST_BRIDGED else (stamp - 1,):
            yield Step(each, np.zeros(0, records.STATE), None)

    def _silence_until(self, stamp: int) -> range:
        """Stamps of the steps without states that a silence until a stamp needs."""
        last = self._stepped
        return range(stamp if last is None else last + _LONGEST_STEP, stamp, _LONGEST_STEP)

    def _changes(self, received: int) -> Iterator[Input]:
        if changes := self.scene.take_changes():
            yield self._descriptions(changes, received)

    def _plans(self, received: int) -> Iterator[Input]:
        for stamp, plans in self.scene.take_plans():
            data = encode_trajectories(stamp, self.mapping.frame, plans)
            yield Input(Topic.TRAJECTORIES, data, received, stamp)

    def _descriptions(self, changes: list[Change], received: int, *, snapshot: bool = False) -> Input:
        stamp = self._time.now_ns if self._time.has_begun else 0
        data = encode_descriptions(stamp, self.mapping.frame, changes, snapshot=snapshot)
        return Input(Topic.SHAPES, data, received, received)

    def _states(self, step: Step, received: int) -> Input:
        covariance = None if step.covariance is None else step.covariance.ravel()
        data = encode_states(step.stamp_ns, self.mapping.frame, 0, step.states, covariance)
        return Input(Topic.STATES, data, received, step.stamp_ns)
