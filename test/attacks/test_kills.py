"""Recordings that end badly: killed at any moment, on a disk that stalls, without a folder."""

from __future__ import annotations

import io
import random
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from session_scene import CONTACTS, PREDICTIONS, STATES, TYPES, inputs

from collision_monitor.codec import decode_contacts
from collision_monitor.pipeline.pipeline import Pipeline
from collision_monitor.session import Recorder, Recording, Session
from collision_monitor.session.mcap.salvage import salvage
from collision_monitor.session.replaying.replay import replay
from collision_monitor.session.replaying.replay_report import Verdict

CHILD = """
import sys, time
sys.path.insert(0, sys.argv[2])
from session_scene import CONTACTS, PREDICTIONS, SHAPES, START, STATES, STEP, TYPES, inputs
from collision_monitor.pipeline.pipeline import Pipeline
from collision_monitor.session import Recorder
pipeline = Pipeline("balanced")
recorder = Recorder(sys.argv[1], TYPES, pipeline.metadata("/object_monitor"), snapshots=True)
now = START
for topic, data in inputs(1_000_000):
    now += STEP
    if topic == SHAPES:
        pipeline.on_shapes(data)
        recorder.write(topic, data, now, now, objects=tuple(pipeline.catalogue.descriptions.values()))
        continue
    outputs = pipeline.on_states(data)
    recorder.write(topic, data, now, now)
    if outputs is not None:
        recorder.write(CONTACTS, outputs.contacts, now, outputs.result.stamp_ns)
        recorder.write(PREDICTIONS, outputs.predictions, now, outputs.result.stamp_ns)
        if outputs.result.step % 20 == 0:
            print(outputs.result.step, time.monotonic(), flush=True)
    if recorder.snapshot_due:
        recorder.write_snapshot(pipeline.snapshot())
    time.sleep(0.0005)
"""

LOST = 1.0
"""s of steps that a kill may lose: twice what the recorder states, because the tests share the machine."""


@pytest.mark.parametrize("seed", range(3))
def test_a_recording_that_is_killed_at_any_moment_replays_up_to_there(tmp_path: Path, seed: int) -> None:
    path = tmp_path / "run.mcap"
    helpers = str(Path(__file__).parents[1] / "helpers")
    child = subprocess.Popen([sys.executable, "-c", CHILD, path, helpers], stdout=subprocess.PIPE, text=True)
    assert child.stdout is not None
    lines = [child.stdout.readline()]  # it steps from now on
    delay = random.Random(seed).uniform(0.4, 1.3)
    while time.monotonic() < float(lines[0].split()[1]) + delay:
        lines.append(child.stdout.readline())
    child.send_signal(signal.SIGKILL)
    lines += child.stdout.readlines()
    assert child.wait() == -signal.SIGKILL
    times = {int(step): float(at) for step, at in (line.split() for line in lines if line.endswith("\n"))}

    session = Session(path)
    recorded = [decode_contacts(m.data).step for m in session.messages() if m.topic == CONTACTS]
    assert recorded == list(range(1, len(recorded) + 1))
    last = max(step for step in times if step <= len(recorded))
    assert max(times.values()) - times[last] < LOST, "what was flushed is there"
    assert session.damage == ["the recording was not closed: it ends without a summary"]
    report = replay(Session(path))
    assert (report.verdict, report.steps) == (Verdict.IDENTICAL, len(recorded))
    saved = tmp_path / "saved.mcap"
    salvage(path, saved)
    again = replay(Session(saved))
    assert (again.verdict, again.steps, again.digest) == (Verdict.IDENTICAL, report.steps, report.digest)


class StallingFile(io.FileIO):
    """A file on a disk that takes nothing while it stalls."""

    stalls = threading.Event()

    def write(self, data: Any) -> int:
        while StallingFile.stalls.is_set():
            time.sleep(0.001)
        return super().write(data)


@pytest.fixture
def stalls(monkeypatch: pytest.MonkeyPatch) -> Iterator[threading.Event]:
    """Let the files of recordings lie on such a disk; yield what makes it stall."""
    real = Path.open

    def opened(path: Path, mode: str = "r", *arguments: Any, **options: Any) -> Any:
        return io.BufferedWriter(StallingFile(path, mode)) if mode == "xb" else real(path, mode, *arguments, **options)

    monkeypatch.setattr(Path, "open", opened)
    yield StallingFile.stalls
    StallingFile.stalls.clear()


def test_a_disk_that_stalls_delays_no_step_and_what_it_cost_is_counted(tmp_path: Path, stalls: threading.Event) -> None:
    pipeline = Pipeline("balanced")
    path = tmp_path / "run.mcap"
    recorder = Recorder(path, TYPES, pipeline.metadata("/object_monitor"), queue_bytes=500_000)
    stalled, after = 0, 0
    for k, (topic, data) in enumerate(inputs(1_000_000)):
        if k == 50:
            stalls.set()
        recorder.write(topic, data, k, k)
        outputs = pipeline.on_states(data) if topic == STATES else pipeline.on_shapes(data) and None
        if outputs is not None:
            recorder.write(CONTACTS, outputs.contacts, k, k)
            recorder.write(PREDICTIONS, outputs.predictions, k, k)
        if stalls.is_set():
            stalled += 1
            if recorder.status()["recording_dropped"] > 100:  # the test ends, so no write waited for the disk
                stalls.clear()
        elif stalled:
            after += 1
            time.sleep(0.002)
        if after == 300:
            break
    recorder.close()
    status = recorder.status()
    assert stalled > 50
    assert (status["recording"], status["recording_error"]) == (Recording.ON, "")
    session = Session(path)
    sequences = [message.sequence for message in session.messages()]
    assert session.damage == []
    missing = sequences[-1] + 1 - len(sequences)
    assert missing == status["recording_dropped"] > 0, "a gap in the sequence for each message that was dropped"
    assert (np.diff(sequences[-300:]) == 1).all(), "after the stall nothing more was lost"
    assert replay(Session(path)).verdict is not Verdict.IDENTICAL, "a session with gaps does not claim to be complete"
