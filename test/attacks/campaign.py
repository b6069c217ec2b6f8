"""One run of attacks on a pipeline in this process, with the known scene between them and limits for every input."""

from __future__ import annotations

import base64
import gc
import json
import os
import time
import traceback
from dataclasses import asdict, dataclass, field
from functools import cache
from pathlib import Path
from random import Random
from typing import Any, Final

import known_scene
import numpy as np
from message_fuzzer import Message, hostile_message
from well_formed import faults_of_contacts, faults_of_predictions

from collision_monitor.codec import decode_contacts, decode_descriptions, decode_predictions, decode_status
from collision_monitor.errors import MessageError
from collision_monitor.monitor.state.snapshot import Snapshot
from collision_monitor.pipeline.pipeline import Outputs, Pipeline
from collision_monitor.pipeline.preparation import Preparation
from collision_monitor.pipeline.settings_event import encode_settings
from collision_monitor.pipeline.topics import Topic
from collision_monitor.session.replaying.difference import compare_status
from collision_monitor.settings.profile import Profile
from collision_monitor.warm_up import warm_up_monitor

RUN: Final = 5_000
"""Messages of one run, which begins with a new pipeline. Longer: a failure takes longer to reproduce."""

START: Final = 1_700_000_000_000_000_000
STEP: Final = 10_000_000
"""ns between two steps of the known scene."""

SLOWEST: Final = 0.1
"""s for one input of up to LARGEST bytes. The time of the processor counts too, as others share the cores."""
YARDSTICK: Final = 0.0105
"""s of the processor that `slowness` took at best on the core on which SLOWEST was measured, in November 2026."""
STUCK: Final = 20.0
"""s of wall time that no input may take, whatever the load: it waits for something that does not come."""
LARGEST: Final = 1 << 20
"""Bytes up to which SLOWEST holds."""

GROWTH: Final = 24e6
"""Bytes by which the resident memory may grow after the first fifth of a run. Larger than what the allocator keeps."""

CHECK_STATUS: Final = 16
"""Inputs from one check of the status to the next."""
RESTART: Final = 1_250
"""Inputs from one restart from a snapshot to the next."""
SHADOW: Final = 40
"""Inputs for which the restored pipeline has to give the same bytes as the one that goes on."""
HOSTILE_SETTINGS: Final = 4
"""Inputs during which hostile settings stay in force. The known answers hold for the default ones."""

PROFILE: Final = Profile(uncertainty_samples=16)
"""Settings of a run. The default 1,024 samples take up to 20 ms for each pair of objects that are uncertain."""

LONG_GAP: Final = 3 * STEP
"""ns without a state after which the scene moves to another place. Objects keep the bounds of a silence of less than
`stale_after` until they leave them, so that their collisions would be UNRESOLVED for a while."""

TRIES: Final = 3
"""States that the scene sends until one is accepted: after a jump of the clock the first has to be confirmed."""


@dataclass(frozen=True)
class Failure:
    """What an input of a run broke, and the input itself."""

    seed: int
    index: int
    problem: str
    topic: str
    data: str  # base64

    def save(self, folder: Path) -> Path:
        """Write it to a file that `fuzz_messages.py --reproduce` reads."""
        folder.mkdir(parents=True, exist_ok=True)
        path = folder / f"attack_{self.seed}_{self.index}.json"
        path.write_text(json.dumps(asdict(self), indent=1) + "\n")
        return path


@dataclass
class Summary:
    """What a run did. slowest: the longest inputs, as (s of wall time, s of the processor, index, bytes)."""

    seed: int
    messages: int = 0
    steps: int = 0
    accepted: int = 0
    refused: dict[str, int] = field(default_factory=dict)
    restarts: int = 0
    digest: int = 0
    slowest: list[tuple[float, float, int, int]] = field(default_factory=list)
    growth: float = 0.0
    failures: list[Failure] = field(default_factory=list)


def settled_memory() -> int:
    """Memory of this process (bytes) without what can be collected."""
    gc.collect()
    return resident()


def note_growth(summary: Any, settled: int, seed: int, messages: int) -> None:
    """Note how much memory grew since a fifth of the messages, when it was `settled` (bytes; 0: not so far yet)."""
    summary.growth = settled_memory() - settled if settled else 0.0
    if summary.growth > GROWTH and not summary.failures:
        problem = f"memory grew by {summary.growth / 1e6:.1f} MB in {messages - messages // 5} messages"
        summary.failures.append(Failure(seed, messages, problem, "", ""))


def slowness() -> float:
    """How many times as long as on that core a fixed piece of work takes here and now, 1 at least.

    Slower processors, and those whose core another program uses, need more of their own time for the same input.
    """
    best = np.inf
    for _ in range(3):
        began = time.process_time()
        sum(k * k % 7 for k in range(160_000))
        best = min(best, time.process_time() - began)
    return max(1.0, best / YARDSTICK)


def resident() -> int:
    """Return the resident memory of this process (bytes)."""
    return int(Path("/proc/self/statm").read_text().split()[1]) * os.sysconf("SC_PAGESIZE")


@cache
def load_kernels() -> None:
    """Load what the first inputs of a process would wait for: kernels, and modules imported at their first use."""
    warm_up_monitor()
    for seed in range(2):
        campaign = Campaign(-1 - seed)
        for index in range(100):
            campaign.attack(index, campaign.message(index))


def is_broken_by(topic: Topic, data: bytes) -> list[str]:
    """Return what one input breaks in a new pipeline with the known scene, before or behind the scene."""
    load_kernels()
    campaign = Campaign(0)
    for index, each in enumerate([Message(Topic.SHAPES, b""), Message(topic, data), Message(Topic.SHAPES, b"")]):
        try:
            campaign.attack(index, each)
        except Exception:
            campaign.problems.append(traceback.format_exc(limit=-6))
    return campaign.problems


class Campaign:
    """Attacks a pipeline. `run` returns at the first failure."""

    def __init__(self, seed: int) -> None:
        self.seed = seed
        self.pipeline = Pipeline(PROFILE, timed=False, preparation=Preparation(limit=0.0))
        self.summary = Summary(seed)
        self._shadow: Pipeline | None = None
        self._shadow_left = 0
        self._settings_left = 0
        self._scene_step = 0
        self._scene_stamp = START
        self._place = 0
        self._is_scene_intact = False
        self.problems: list[str] = []

    def run(self, messages: int = RUN) -> Summary:
        """Send this many messages."""
        load_kernels()
        gc.collect()
        gc.freeze()  # a collection among the objects of kernels and of other tests takes longer than a message may
        summary, settled = self.summary, 0
        for index in range(messages):
            message = self.message(index)
            try:
                self.attack(index, message)
            except Exception:  # what no method of the pipeline may raise is a finding, with its place
                self.problems.append(traceback.format_exc(limit=-6))
            if self.problems:
                data = base64.b64encode(message.data).decode()
                problem = "\n".join(self.problems)
                summary.failures.append(Failure(self.seed, index, problem, message.topic.name, data))
                break
            summary.messages += 1
            if index == messages // 5:
                settled = settled_memory()
        note_growth(summary, settled, self.seed, messages)
        monitor = self.pipeline.monitor
        summary.digest = monitor.digest
        summary.refused = {reason.value: count for reason, count in monitor.refused.items()}
        return summary

    def message(self, index: int) -> Message:
        """Return the message of the run with this index, as it is sent now."""
        return hostile_message(self.seed, index, self.now)

    def attack(self, index: int, message: Message) -> None:
        """Send one message, check its answer, and mostly let the known scene ask."""
        if index % RESTART == RESTART // 2:
            self._restart(index)
        self._send(index, message)
        if message.topic is Topic.SETTINGS:
            self._settings_left = HOSTILE_SETTINGS
        elif message.topic is Topic.SHAPES and _may_change_the_scene(message.data):
            self._is_scene_intact = False
        if index % CHECK_STATUS == 0:
            decode_status(self.pipeline.status(silent=index % 3 == 0))
        if Random(index).random() < 0.45:  # at times two attacks follow each other, to confirm each other's stamps
            self._ask_the_scene(index)

    @property
    def now(self) -> int:
        """The monitor's latest time (ns)."""
        last = self.pipeline.monitor.last
        return START if last is None else last.stamp_ns

    # -- inputs

    def _send(self, index: int, message: Message) -> Outputs | None:
        """Send a message to the pipeline and to its shadow. Check the limits and the form of the answers."""
        wall, cpu = time.perf_counter(), time.process_time()
        outputs, taken = _process(self.pipeline, message)
        wall, cpu = time.perf_counter() - wall, time.process_time() - cpu
        self._check_time(index, message, wall, cpu)
        self._check_answers(outputs)
        if self._shadow is not None:
            self._compare_with_shadow(taken, outputs)
        return outputs

    def _check_time(self, index: int, message: Message, wall: float, cpu: float) -> None:
        slowest, size = self.summary.slowest, len(message.data)
        slowest.append((wall, cpu, index, size))
        if len(slowest) > 64:
            slowest.sort(reverse=True)
            del slowest[5:]
        took = min(wall, cpu)
        if size <= LARGEST and (took > SLOWEST * (slowness() if took > SLOWEST else 1.0) or wall > STUCK):
            self.problems.append(f"{size} bytes took {wall:.3f} s, {cpu:.3f} s of the processor")

    def _check_answers(self, outputs: Outputs | None) -> None:
        if outputs is None:
            return
        self.summary.steps += 1
        self.problems += faults_of_contacts(decode_contacts(outputs.contacts))
        self.problems += faults_of_predictions(decode_predictions(outputs.predictions))

    # -- the known scene

    def _ask_the_scene(self, index: int) -> None:
        if self._settings_left > 0:
            self._settings_left -= 1
            if self._settings_left > 0:
                return
            self._restore_settings(index)
        if not self._is_scene_intact:
            self._send(index, Message(Topic.SHAPES, known_scene.descriptions(0, snapshot=True)))
            self._is_scene_intact = True
        self._scene_step += 1
        if self.now > self._scene_stamp + LONG_GAP:
            self._place += 1
        for tried in range(TRIES):
            stamp = self.now + STEP
            if not -(2**31) <= stamp // 1_000_000_000 < 2**31:
                stamp = START + tried * STEP  # no message can hold a later stamp; a duplicate confirms no jump
            outputs = self._send(index, Message(Topic.STATES, known_scene.states(self._scene_step, self._place, stamp)))
            if outputs is not None and outputs.result.stamp_ns == stamp:
                contacts, predictions = decode_contacts(outputs.contacts), decode_predictions(outputs.predictions)
                self.problems += known_scene.wrong(self._scene_step, contacts, predictions)
                self.summary.accepted += 1
                self._scene_stamp = stamp
                return
        self.problems.append(f"no answer to the known scene: {self.pipeline.monitor.last_refusal}")

    def _restore_settings(self, index: int) -> None:
        changes: dict[str, Any] = self.pipeline.monitor.profile.differences(PROFILE)
        if changes:
            self._send(index, Message(Topic.SETTINGS, encode_settings(0, "", changes)))
        if self.pipeline.monitor.profile != PROFILE:
            self.problems.append("the settings cannot be restored")

    # -- restarts from a snapshot

    def _restart(self, index: int) -> None:
        """From here on, a pipeline restored from a snapshot's bytes has to give the same answers for a while."""
        snapshot = Snapshot.decode(self.pipeline.snapshot().encode())
        self._shadow, self._shadow_left = Pipeline.restored(snapshot, self.pipeline.frame_id), SHADOW
        self.summary.restarts += 1

    def _compare_with_shadow(self, taken: Message, outputs: Outputs | None) -> None:
        assert self._shadow is not None
        if outputs is not None and outputs.settings is not None:  # a session holds it before the states
            self._shadow.on_settings(outputs.settings)
        other, _ = _process(self._shadow, taken)
        if _bytes(outputs) != _bytes(other) or self.pipeline.monitor.digest != self._shadow.monitor.digest:
            self.problems.append("the pipeline restored from a snapshot gives other bytes")
        difference = compare_status("status", 0, self.pipeline.status(), self._shadow.status())
        if difference:
            self.problems.append(f"the pipeline restored from a snapshot has another status: {difference}")
        self._shadow_left -= 1
        if self._shadow_left == 0:
            self._shadow = None


def _process(pipeline: Pipeline, message: Message) -> tuple[Outputs | None, Message]:
    """Return the answer, and the message as a session holds it."""
    match message.topic:
        case Topic.STATES:
            return pipeline.on_states(message.data), message
        case Topic.SHAPES:
            taken = pipeline.take_shapes(message.data).data
            pipeline.take_prepared()
            return None, Message(Topic.SHAPES, taken)
        case Topic.TRAJECTORIES:
            pipeline.on_trajectories(message.data)
            return None, message
    pipeline.on_settings(message.data)
    return None, message


def _bytes(outputs: Outputs | None) -> tuple[bytes, bytes, int] | None:
    return None if outputs is None else (outputs.contacts, outputs.predictions, outputs.digest)


def _may_change_the_scene(data: bytes) -> bool:
    try:
        return known_scene.changes_the_scene(decode_descriptions(data))
    except MessageError:
        return False
