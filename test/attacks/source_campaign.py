"""One run of attacks on the sources in this process, with messages of known objects between them.

Of each known object a good message has to become a state, whatever came before: an object that moves in the monitor's
frame, one in a frame of tf of its own, and one without a stamp. An error that a source did not expect is a finding, as
is a message of up to 1 MB that takes longer than 0.1 s, a known object that is lost, and memory that grows.
"""

from __future__ import annotations

import base64
import gc
import time
import traceback
from collections import Counter
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from random import Random
from typing import Any, Final

import numpy as np
from campaign import LARGEST, SLOWEST, START, STUCK, Failure, note_growth, settled_memory
from dice import Dice
from foreign_bag import STORE, odometry, pose_stamped, transforms
from ros_messages import definitions
from source_messages import MAKERS, SourceMessage, hostile_source_message

from collision_monitor.codec import decode_descriptions, decode_states, decode_trajectories
from collision_monitor.errors import MessageError
from collision_monitor.pipeline.topics import Topic
from collision_monitor.sources import Decoder, Feed, Input, RawMessage
from collision_monitor.sources.decoding import decodes_slowly
from collision_monitor.sources.ground.mapping import Mapping, make_mapping
from collision_monitor.sources.ground.source_scene import MOST_COUNTED, MOST_TEXTS
from collision_monitor.sources.ground.unmonitored import MOST_ROWS

SOURCE_RUN: Final = 5_000
"""Messages of one run, which begins with a new feed."""

SOURCE_STEP: Final = 60_000_000
"""ns between two messages of a known object: more than the period of the steps of a file with a rate."""

SOURCE_TRIES: Final = 4
"""Messages of a known object, of which the last one at least has to become a state: the first ones may have to confirm
that a jump of time was one."""

ALLOWED_AT_ONCE: Final = 200
"""New objects of one message, as in a node."""

STEPPING: Final[tuple[dict[str, Any], ...]] = (
    *({}, {"rate": 20}, {"rate": 50}),
    *({"step": "/known"}, {"stamps": "received"}),
)
"""How the steps are made, by the seed."""

ARM: Final = Path(__file__).parents[2] / "examples/arm/arm.urdf"


class NoPreparation:
    """In place of the process that makes large robots: it makes none."""

    is_busy = False

    def start(self, name: str, *job: Any) -> None:
        """Drop the job."""

    def ended(self, name: str) -> str:
        """Return why there is no robot."""
        return "no robot is made beside this test"


def attacked_mapping(seed: int) -> Mapping:
    """Return a file with an entry for each type of message, a robot from a file and one from a topic."""
    ball = {"sphere": 0.3}
    objects: dict[str, Any] = {
        "floor": {"static": True, "shape": {"half_space": [0, 0, 1, -50]}},
        "shelf": {"static": True, "frame": "base", "shape": ball},
        "known": {"topic": "/known", "shape": ball},
        "known_in_tf": {"topic": "/known_in_tf", "shape": ball},
        "known_without_stamp": {"topic": "/known_without_stamp", "shape": ball},
        "cart": {"topic": "/odom", "shape": ball},
        "person": {"topic": "/pose", "shape": ball, "estimate_over": 0.3},
        "cup": {"topic": "/pose_with_covariance", "shape": ball},
        "tool": {"topic": "/tf", "frame": "sensor", "shape": ball},
        "one": {"topic": "/marker", "marker": {"ns": "a", "id": 3}},
        "group": {"topic": "/markers", "marker": {"ns": "a"}, "forget_after": 1.0},
        "walls": {"topic": "/markers", "marker": {"ns": "b"}, "static": True},
        "cars": {"topic": "/tracked", "min_existence": 0.2},
        "others": {"topic": "/predicted"},
        "people": {"topic": "/detections"},
        "trolley": {"topic": "/footprint", "height": 1.0 if seed % 2 else 0.0},
        "laser": {"topic": "/scan", "without": ["cart"]},
        "depth": {"topic": "/cloud", "voxel": 0.1},
        "world": {"topic": "/world"},
        "things": {"topic": "/object"},
        "last": {"topic": "/odom", "shape": ball, "id": 4294967295},
    }
    robots = {
        "arm": {"urdf": str(ARM), "joint_states": "/joint_states", "base": {"odometry": "/base_odom", "link": "base"},
                "planning_scene": "/arm_scene"},
        "described": {"urdf_topic": "/robot_description", "srdf_topic": "/srdf", "joint_states": "/joint_states",
                      "base": {"frame": "base"}},
    }  # fmt: skip
    return make_mapping({"frame": "map", **STEPPING[seed % len(STEPPING)], "objects": objects, "robots": robots})


class _Collections:
    """Seconds of the processor that the garbage collector took, which is no cost of the message that it interrupts."""

    def __init__(self) -> None:
        self.total = 0.0
        self._began = 0.0

    def __call__(self, phase: str, _info: dict[str, int]) -> None:
        now = time.process_time()
        if phase == "stop":
            self.total += now - self._began
        self._began = now


@cache
def collections() -> _Collections:
    """Return the watch of the collector of this process."""
    watch = _Collections()
    gc.callbacks.append(watch)
    return watch


@cache
def attacked_decoder() -> Decoder:
    """Return a decoder of all types, which generates their code once."""
    return Decoder(definitions())


@dataclass
class SourceSummary:
    """What a run did. slowest: s of the processor of the longest message of each topic."""

    seed: int
    messages: int = 0
    known: int = 0
    states: int = 0
    descriptions: int = 0
    refused: int = 0
    by_topic: Counter[str] = field(default_factory=Counter)
    slowest: dict[str, float] = field(default_factory=dict)
    growth: float = 0.0
    failures: list[Failure] = field(default_factory=list)


class SourceCampaign:
    """Attacks a feed. `run` returns at the first failure."""

    def __init__(self, seed: int) -> None:
        self.summary = SourceSummary(seed)
        self.problems: list[str] = []
        self._seed = seed
        preparation: Any = NoPreparation()
        mapping = attacked_mapping(seed)
        self.feed = Feed(mapping, attacked_decoder(), allowance=ALLOWED_AT_ONCE, preparation=preparation)
        for topic, maker in MAKERS.items():
            kind, _ = maker(Dice(0, 0), START)
            if topic in mapping.topics:
                assert not self.feed.bind(topic, kind)
        for topic, (kind, _) in _known(START).items():
            if topic in mapping.topics:
                assert not self.feed.bind(topic, kind)
        self._ids = {entry.name: entry.object_id for entry in mapping.sources}
        self._received = START
        self._stamp = START
        self._check(self.feed.begin(self._received))

    def run(self, messages: int = SOURCE_RUN) -> SourceSummary:
        """Send this many hostile messages."""
        load_sources()
        summary, settled = self.summary, 0
        for index in range(messages):
            self._received += Random(index).randrange(1_000_000, 30_000_000)
            self._stamp = max(self._stamp, self.feed_now)
            attack = hostile_source_message(self._seed, index, self._stamp)
            self._attack(attack)
            if Random(index).random() < 0.3:
                self._ask()
            if self.problems:
                data = base64.b64encode(attack.data).decode()
                failure = Failure(self._seed, index, "\n".join(self.problems), attack.topic, data)
                summary.failures.append(failure)
                break
            summary.messages += 1
            if index == messages // 5:
                settled = settled_memory()
        note_growth(summary, settled, self._seed, messages)
        summary.refused = sum(self.feed.scene.refused.values())
        return summary

    @property
    def feed_now(self) -> int:
        """The latest time of the sources (ns)."""
        time_ = self.feed.scene.time
        return time_.now_ns if time_.has_begun else START

    def _attack(self, attack: SourceMessage) -> None:
        summary = self.summary
        summary.by_topic[attack.topic] += 1
        took = self._send(RawMessage(attack.topic, attack.type, attack.data, self._received))
        summary.slowest[attack.topic] = max(summary.slowest.get(attack.topic, 0.0), took)
        scene = self.feed.scene
        sizes = len(scene.states), len(scene.refused), len(self.feed.unmonitored)
        if sizes[0] > MOST_COUNTED + 1 or sizes[1] > MOST_TEXTS + 1 or sizes[2] > MOST_ROWS + 1:
            self.problems.append(f"more names, texts or rows than there may be: {sizes}")
        if scene.is_behind:
            self._check(self.feed.go_on(self._received))

    def _send(self, raw: RawMessage) -> float:
        """Give a message to the feed; return the seconds of the processor that it took."""
        content = None
        if decodes_slowly(raw.type, len(raw.data)):  # a node lets a thread decode it
            try:
                content = attacked_decoder()(raw.type, raw.data)
            except MessageError as error:
                content = error
        wall, cpu, collected = time.perf_counter(), time.process_time(), collections().total
        try:
            inputs = self.feed.take(raw) if content is None else self.feed.take_decoded(raw, content)
        except Exception:  # what no method of a feed may raise is a finding, with its place
            self.problems.append(traceback.format_exc(limit=-6))
            return 0.0
        wall, cpu = time.perf_counter() - wall, time.process_time() - cpu - (collections().total - collected)
        if len(raw.data) <= LARGEST and (min(wall, cpu) > SLOWEST or wall > STUCK):
            took = f"took {wall:.3f} s, {cpu:.3f} s of the processor"
            self.problems.append(f"{len(raw.data)} bytes on {raw.topic} {took}")
        self.problems += [f"{each.line}: {each.text}" for each in self.feed.take_failures()]
        self._check(inputs)
        self.feed.scene.take_news()
        return cpu

    def _check(self, inputs: list[Input]) -> list[Any]:
        """Check that the monitor can read the inputs; return the rows of their states."""
        rows = []
        for each in inputs:
            if each.topic is Topic.STATES:
                states = decode_states(each.data).states
                self.summary.states += len(states)
                rows += list(states)
                if len(np.unique(states["id"])) != len(states):
                    self.problems.append("a step holds two states of one object")
            elif each.topic is Topic.TRAJECTORIES:
                decode_trajectories(each.data)
            else:
                message = decode_descriptions(each.data)
                self.summary.descriptions += len(message.objects)
                if message.refused:
                    self.problems.append(f"a description that cannot be read: {message.refused[0]}")
        return rows

    def send(self, raw: RawMessage) -> list[str]:
        """Give one message to the feed; return what it breaks."""
        self._send(raw)
        return self.problems

    # -- the known objects

    def _ask(self) -> None:
        """Send messages of the known objects until each has become a state; at most SOURCE_TRIES of each."""
        missing = {"known", "known_in_tf", "known_without_stamp"}
        for tried in range(SOURCE_TRIES):
            self._received += SOURCE_STEP
            self._stamp = self.feed_now + SOURCE_STEP
            if self._stamp >= 2**31 * 1_000_000_000:  # no message can hold a later stamp
                self._stamp = START + tried * SOURCE_STEP  # a duplicate confirms no jump
            x = self._stamp / 1e9 % 10.0
            for topic, (kind, content) in _known(self._stamp, x).items():
                data = bytes(STORE.serialize_cdr(content, kind))
                for row in self._rows(RawMessage(topic, kind, data, self._received)):
                    for name in list(missing):
                        if row["id"] == self._ids[name] and self._is_right(name, row, x):
                            missing.discard(name)
            if not missing:
                self.summary.known += 1
                return
        self.problems.append(f"lost: {sorted(missing)}; last refusals: {self.feed.scene.last_refusal}")

    def _rows(self, raw: RawMessage) -> list[Any]:
        try:
            rows = self._check(self.feed.take(raw))
        except Exception:
            self.problems.append(traceback.format_exc(limit=-6))
            return []
        self.problems += [f"{each.line}: {each.text}" for each in self.feed.take_failures()]
        return rows

    def _is_right(self, name: str, row: Any, x: float) -> bool:
        """Whether a state is where its object was, up to its way to the step."""
        place = {"known": (x, 1.0), "known_in_tf": (x, 2.0), "known_without_stamp": (5.0, 3.0)}[name]
        return bool(np.abs(row["position"][:2] - place).max() <= 1.0)


def broken_by(raw: RawMessage) -> list[str]:
    """Return what a message breaks on the topics of its type, in a new feed for each way to make steps."""
    load_sources()
    topics = [topic for topic, maker in MAKERS.items() if maker(Dice(0, 0), START)[0] == raw.type]
    found = [SourceCampaign(seed).send(raw._replace(topic=topic)) for topic in topics for seed in range(len(STEPPING))]
    return [problem for problems in found for problem in problems]


def _known(now: int, x: float = 0.0) -> dict[str, tuple[str, Any]]:
    return {
        "/tf": transforms(now, ("map", "known_frame", (x, 0, 0), (0, 0, 0, 1))),
        "/known_in_tf": pose_stamped("known_frame", now, (0, 2, 0)),
        "/known_without_stamp": pose_stamped("map", 0, (5, 3, 0)),
        "/known": odometry("map", now, (x, 1, 0), (0, 0, 0, 1), (0, 0, 0), (0, 0, 0)),
    }


@cache
def load_sources() -> None:
    """Load what the first messages of a process would wait for: kernels, generated code, modules used later."""
    for seed in range(2):
        campaign = SourceCampaign(-1 - seed)
        for index in range(300):
            attack = hostile_source_message(-1 - seed, index, START + index * SOURCE_STEP)
            campaign.feed.take(RawMessage(attack.topic, attack.type, attack.data, START + index))
    gc.collect()
    gc.freeze()
