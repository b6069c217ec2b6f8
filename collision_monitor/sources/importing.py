"""Makes a session from a bag: its messages become the monitor's inputs, and the monitor answers them."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import dataclass, field
from itertools import chain
from pathlib import Path
from typing import Final

from collision_monitor.alerts.rules import Rules
from collision_monitor.codec import decode_states
from collision_monitor.errors import CollisionMonitorError, InputError, MessageError, Refusal, SessionError
from collision_monitor.pipeline.pipeline import Pipeline
from collision_monitor.pipeline.topics import NODE, RECORDED, STATUS_PERIOD, Topic
from collision_monitor.session.output_file import check_recording
from collision_monitor.session.recording.recorder import Recorder
from collision_monitor.session.recording.recording_state import Recording
from collision_monitor.settings.profile import Profile
from collision_monitor.sources.bag import Bag
from collision_monitor.sources.decoding import Decoder
from collision_monitor.sources.failures import FailureFiles
from collision_monitor.sources.feed import STATIC, Feed, Input
from collision_monitor.sources.ground.mapping import Mapping
from collision_monitor.sources.ground.unmonitored import Unmonitored, UnmonitoredRecord
from collision_monitor.sources.kinds import BY_TYPE
from collision_monitor.sources.messages.tf_objects import TRANSFORMS

_INPUTS: Final = (Topic.STATES, Topic.SHAPES, Topic.TRAJECTORIES)
_REPEATED: Final = (Topic.MONITORED_STATES.path, Topic.MONITORED_SHAPES.path, Topic.MONITORED_PLANS.path)
"""Where a monitor publishes its inputs again; used only if a bag lacks the inputs, which came from sources."""


@dataclass
class Imported:
    """Result of an import. states: number of states of each object. skipped, refused: what was left out, by reason.

    unmonitored: what the mapping asks for and was not monitored at the end of the bag. failures: files with the
    messages of unexpected errors, which are to be reported.
    """

    messages: int = 0
    steps: int = 0
    states: dict[str, int] = field(default_factory=dict)
    skipped: dict[str, int] = field(default_factory=dict)
    refused: dict[str, int] = field(default_factory=dict)
    last_refusal: str = ""
    unmonitored: list[Unmonitored] = field(default_factory=list)
    failures: list[str] = field(default_factory=list)

    @property
    def unseen(self) -> list[str]:
        """Moving objects of the mapping for which the bag holds no usable state."""
        return sorted(name for name, count in self.states.items() if not count)

    @property
    def whole(self) -> bool:
        """Whether nothing was left out."""
        return not (self.skipped or self.refused or self.unseen)


def import_bag(
    source: Path,
    target: Path,
    mapping: Mapping | None = None,
    *,
    profile: Profile | str = "balanced",
    rules: Rules | None = None,
    node: str | None = None,
    overwrite: bool = False,
    progress: Callable[[Imported], None] | None = None,
) -> Imported:
    """Write the session `target` from the bag `source`.

    Without a mapping the bag must hold a monitor's inputs; node: the monitor to use, if there are several. rules: for
    the alerts. Raises SessionError or InputError; then there is no target.
    """
    result, feed = Imported(), None
    check_recording(target, overwrite=overwrite, inputs=[source])
    with Bag(source) as bag:
        if mapping is None:
            frame_id, inputs = _recorded_inputs(bag, node)
        else:
            feed = _feed_of(bag, mapping)
            frame_id, inputs = mapping.frame, _mapped_inputs(bag, feed)
        pipeline = Pipeline(profile, frame_id=frame_id, timed=False, rules=rules)
        if feed is not None:
            feed.scene.horizon = pipeline.profile.horizon
        _write(inputs, feed, target, pipeline, result, overwrite, progress)
    if feed is not None:
        result.states, result.skipped = dict(feed.scene.states), dict(feed.scene.refused)
        result.unmonitored = list(feed.unmonitored)
        files = FailureFiles(target.with_name(f"{target.stem}_failures"))
        kept = [files.keep(failure) for failure in feed.take_failures()]
        result.failures = [str(path) for path, is_new in kept if path is not None and is_new]
    return result


def _write(
    inputs: Iterator[Input],
    feed: Feed | None,
    target: Path,
    pipeline: Pipeline,
    result: Imported,
    overwrite: bool,
    progress: Callable[[Imported], None] | None,
) -> None:
    """Feed the inputs and record them with the answers. If that fails, remove the target."""
    first = next(inputs, None)  # read first, so that an unusable bag leaves no file
    if first is None:
        raise SessionError("expected messages of the mapped topics in the bag, got none")
    left_out = {Topic.SETTINGS}
    plans = feed is not None and any(name in feed.mapping.sections for name in ("plans", "robots"))
    left_out |= set() if plans else {Topic.TRAJECTORIES}
    left_out |= set() if pipeline.rules.text else {Topic.ALERTS}
    left_out |= set() if feed is not None else {Topic.SOURCES}
    types = {topic.of(): topic.message for topic in RECORDED if topic not in left_out}
    recorder = Recorder(target, types, pipeline.metadata(node=f"/{NODE}"), overwrite=overwrite, patient=True)
    try:
        _feed(first, inputs, feed, pipeline, recorder, result, progress)
    except BaseException:
        recorder.close()
        _remove(target)
        raise
    recorder.close()
    status = recorder.status()
    if status["recording"] == Recording.FAILED:
        _remove(target)
        raise SessionError(str(status["recording_error"]))
    result.refused = {reason.value: count for reason, count in pipeline.monitor.refused.items() if count}
    result.last_refusal = pipeline.monitor.last_refusal


def _feed(
    first: Input,
    others: Iterator[Input],
    feed: Feed | None,
    pipeline: Pipeline,
    recorder: Recorder,
    result: Imported,
    progress: Callable[[Imported], None] | None,
) -> None:
    """Feed the pipeline and record its inputs and answers. Raises InputError if the first description is refused."""

    def record(topic: Topic, data: bytes, publish_time: int) -> None:
        recorder.write(topic.of(), data, now, publish_time)

    missing = UnmonitoredRecord(NODE)
    last_status = now = first.log_time
    record(Topic.STATUS, pipeline.status(), now)
    for each in chain([first], others):
        now = each.log_time
        if feed is not None and (data := missing.changed(feed.unmonitored, now)) is not None:
            record(Topic.SOURCES, data, now)
        outputs = None
        if each.topic is Topic.STATES:
            outputs = pipeline.on_states(each.data)
        elif each.topic is Topic.TRAJECTORIES:
            pipeline.on_trajectories(each.data)
        else:
            pipeline.on_shapes(each.data)
            if each is first and pipeline.monitor.refused[Refusal.SHAPE]:
                raise InputError(pipeline.monitor.last_refusal)
        record(each.topic, each.data, each.publish_time)
        result.messages += 1
        if outputs is not None:
            result.steps = outputs.result.step
            record(Topic.CONTACTS, outputs.contacts, outputs.result.stamp_ns)
            record(Topic.PREDICTIONS, outputs.predictions, outputs.result.stamp_ns)
            for alert in outputs.alerts:
                record(Topic.ALERTS, alert, outputs.result.stamp_ns)
            if not 0 <= now - last_status < STATUS_PERIOD:  # the clock of receipt may go back, too
                last_status = now
                record(Topic.STATUS, pipeline.status(), now)
        if progress is not None:
            progress(result)
    if feed is not None and (data := missing.changed(feed.unmonitored, now)) is not None:
        record(Topic.SOURCES, data, now)
    record(Topic.STATUS, pipeline.status(), now)


def _remove(target: Path) -> None:
    with suppress(OSError):
        if target.is_dir():
            for path in [*target.glob(f"{target.name}_*.mcap"), target / "metadata.yaml"]:
                path.unlink(missing_ok=True)
            target.rmdir()
        else:
            target.unlink()


# -- bags with other topics


def _feed_of(bag: Bag, mapping: Mapping) -> Feed:
    """Return a feed that knows the types of the bag's topics. Raises SessionError, InputError."""
    decoder = Decoder({})
    feed = Feed(mapping, decoder)
    decoder.use(bag.definitions([*feed.wanted, *_transform_topics(bag)]))
    for topic, types in feed.wanted.items():
        if topic not in bag.topics:
            usable = [f"{name} ({each})" for name, each in sorted(bag.topics.items()) if each in BY_TYPE]
            entries = [entry.name for entry in mapping.topics.get(topic, ())] or [*mapping.sections]
            raise SessionError(
                f"{entries[0]}: expected topic {topic} in the bag, got none; "
                f"what can be mapped there is {', '.join(usable) or 'nothing'}"
            )
        if topic in mapping.topics:
            for problem in feed.bind(topic, bag.topics[topic]).values():
                raise SessionError(mapping.located(problem))
        elif bag.topics[topic] not in types:
            raise SessionError(f"expected {topic} to carry {' or '.join(types)}, got {bag.topics[topic]}")
    return feed


def _mapped_inputs(bag: Bag, feed: Feed) -> Iterator[Input]:
    """Yield the inputs of the monitor. The static transforms of the whole bag hold from its start."""
    topics = _transform_topics(bag)
    static = [topic for topic in topics if topic.endswith(STATIC) and topic not in feed.mapping.topics]
    others = {*feed.wanted, *topics} - set(static)
    begun = False
    for raw in chain(bag.messages(static), bag.messages(others)):
        if not begun:
            begun = True
            yield from feed.begin(raw.received)
        if raw.topic not in static and static:
            static = []
            _require_placed(feed)
        yield from feed.take(raw)
    if begun:
        _require_placed(feed)


def _transform_topics(bag: Bag) -> list[str]:
    return [topic for topic, kind in bag.topics.items() if kind == TRANSFORMS]


def _require_placed(feed: Feed) -> None:
    if feed.misplaced:
        raise SessionError(feed.misplaced[0])


# -- bags with a monitor's topics


def _recorded_inputs(bag: Bag, node: str | None) -> tuple[str, Iterator[Input]]:
    """Return the frame of the states, and the inputs as they were recorded."""
    chosen: dict[str, Topic] = {}
    for topic in _INPUTS:
        found = [name for name, kind in bag.topics.items() if kind == topic.type_name]
        found = [name for name in found if not name.endswith(_REPEATED)] or found
        if node is not None:
            found = [name for name in found if name.startswith(f"{node.rstrip('/')}/")]
        if len(found) > 1:
            raise SessionError(
                f"{bag.path}: expected the inputs of one monitor, got {', '.join(sorted(found))}; "
                f"choose with --node, such as --node {found[0].removesuffix(f'/{Topic.STATES.path}')}"
            )
        if found:
            chosen[found[0]] = topic
    if Topic.STATES not in chosen.values():
        there = ", ".join(f"{topic} ({kind})" for topic, kind in sorted(bag.topics.items())) or "no topics"
        raise SessionError(
            f"{bag.path}: expected {Topic.STATES.type_name}{f' of {node}' if node else ''}, got {there}; "
            "for other topics give a mapping file (--map)"
        )
    frame_id = ""
    for raw in bag.messages([name for name, topic in chosen.items() if topic is Topic.STATES]):
        with suppress(CollisionMonitorError):
            frame_id = decode_states(raw.data).frame_id
            break
    return frame_id or "world", _inputs(bag, chosen)


def _inputs(bag: Bag, chosen: dict[str, Topic]) -> Iterator[Input]:
    for raw in bag.messages(chosen):
        stamp = raw.received
        if chosen[raw.topic] is Topic.STATES:
            with suppress(MessageError):
                stamp = decode_states(raw.data).stamp_ns
        yield Input(chosen[raw.topic], bytes(raw.data), raw.received, stamp)
