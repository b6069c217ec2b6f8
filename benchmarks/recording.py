"""Measure the cost of recording and the loss of a killed process.

    python benchmarks/recording.py            # three minutes
    python benchmarks/recording.py --quick    # half a minute

Sustained: messages of 1 kB, written as fast as the disk takes them, none dropped. Step: the same steps alone, beside
20,000 messages/s that are discarded, and beside a recorder that writes them. The three arms alternate in blocks within
one run, so that other load affects all of them equally. Beside its work: for the last arm, the mean of all steps over
the mean of the steps during which the recorder's thread slept; other load hardly changes this ratio. Killed: a process
that records 20,000 messages/s is killed (SIGKILL) at a random moment; the loss is the time between the last message in
the file and the signal.
"""

from __future__ import annotations

import argparse
import gc
import json
import os
import random
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from collision_monitor import records
from collision_monitor.codec import encode_descriptions, encode_states
from collision_monitor.objects.description import ObjectDescription
from collision_monitor.pipeline.pipeline import Pipeline
from collision_monitor.session import Recorder, Session
from collision_monitor.session.replaying.replay import replay
from collision_monitor.shapes.registry import Box

NODE = "/object_monitor"
TYPES = {
    f"{NODE}/objects/shapes": "ObjectDescriptionArray",
    f"{NODE}/objects/states": "ObjectStateArray",
    f"{NODE}/contacts": "ContactArray",
    f"{NODE}/predictions": "PredictedCollisionArray",
}
SHAPES, STATES, CONTACTS, PREDICTIONS = TYPES
OBJECTS = 200
WARM = 200
ROUNDS = {False: 60, True: 8}
"""Number of rounds of three blocks, by --quick."""
QUIET = 0.25
"""Most cores that other processes take during a quiet round: a step that shares its core does not measure the
recorder."""
RATE = 20_000
"""Messages/s that the recorder takes while steps are timed."""
DIFFERENT = 1 << 14
"""Messages before one is written again: more than a chunk holds, or they would be compressed to nothing."""

CHILD = """
import sys, time
import numpy as np
from collision_monitor.session import Recorder
data = bytes(np.random.default_rng(1).normal(size=120).tobytes())
recorder = Recorder(sys.argv[1], {"/x/states": "ObjectStateArray"}, {"profile": "{}", "frame_id": "world"})
print("ready", flush=True)
begin, k = time.time(), 0
while True:
    while k < (time.time() - begin) * 20_000:
        recorder.write("/x/states", k.to_bytes(8, "little") + data, time.time_ns(), 1)
        k += 1
    time.sleep(0.0005)
"""


def payloads(count: int) -> list[bytes]:
    """Messages of 1 kB that compress as little as states do."""
    return [row.tobytes() for row in np.random.default_rng(0).normal(size=(count, 128))]


def sustained(folder: Path, seconds: float) -> dict[str, float]:
    """Messages/s and MB/s that reach the operating system, through the queue."""
    data = payloads(DIFFERENT)
    recorder = Recorder(folder / "sustained.mcap", TYPES, {"profile": "{}"}, patient=True, queue_bytes=16 << 20)
    begin, k = time.perf_counter(), 0
    while time.perf_counter() - begin < seconds:
        for _ in range(500):
            recorder.write(STATES, data[k % DIFFERENT], k, k)
            k += 1
    recorder.close()
    took = time.perf_counter() - begin
    status = recorder.status()
    assert (status["recorded_messages"], status["recording_dropped"]) == (k, 0)
    return {"messages_per_s": k / took, "MB_per_s": k * len(data[0]) / took / 1e6}


class Crossing:
    """Boxes that cross each other's paths, all of them in every message."""

    def __init__(self) -> None:
        rng = np.random.default_rng(5)
        self.size = rng.uniform(0.4, 1.2, (OBJECTS, 3))
        self.start, self.velocity = rng.uniform(0, 14, (OBJECTS, 3)), rng.uniform(-1, 1, (OBJECTS, 3))

    def shapes(self) -> bytes:
        """Encoded ObjectDescriptionArray."""
        objects = [ObjectDescription(i + 1, Box(tuple(size))) for i, size in enumerate(self.size)]
        return encode_descriptions(0, "world", objects, snapshot=True)

    def states(self, step: int) -> bytes:
        """Encoded ObjectStateArray of the step."""
        rows = np.zeros(OBJECTS, records.STATE)
        rows["id"] = np.arange(1, OBJECTS + 1)
        rows["quaternion"][:, 3] = 1.0
        phase = self.start + 0.02 * step * self.velocity
        rows["position"] = np.abs((phase % 28.0) - 14.0)  # back and forth between walls
        rows["linear"] = np.where(phase % 28.0 < 14.0, -self.velocity, self.velocity)
        return encode_states(1_000_000_000 + step * 20_000_000, "world", step + 1, rows)


class Nobody:
    """Discards all messages, to measure the cost of making and passing them on."""

    def write(self, topic: str, data: bytes, log_time: int, publish_time: int) -> None:
        """Discard a message; the signature is Recorder.write's."""


def watched(recorder: Recorder) -> list[tuple[float, float]]:
    """Begin and end (s) of the turns and flushes of the recorder's thread; the list grows from now on."""
    spans: list[tuple[float, float]] = []
    parts: Any = recorder._parts

    def watch(work: Callable[..., Any]) -> Callable[..., Any]:
        def run(*given: Any) -> Any:
            begin = time.perf_counter()
            done = work(*given)
            spans.append((begin, time.perf_counter()))
            return done

        return run

    parts.write, parts.flush = watch(parts.write), watch(parts.flush)
    return spans


def beside_its_work(steps: list[tuple[float, float]], spans: list[tuple[float, float]]) -> float:
    """Mean duration of all steps (begin, end; in order) over that of the steps that overlap no span."""
    begin, end = np.array(steps).T
    met = np.zeros(len(steps), np.bool_)
    for since, until in spans:
        met[np.searchsorted(end, since) : np.searchsorted(begin, until)] = True
    took = end - begin
    return float(took.mean() / took[~met].mean())


def step_cost(folder: Path, rounds: int, steps: int) -> dict[str, float]:
    """Duration of a step alone, beside messages that are discarded, and beside a recorder.

    Ratios are medians over rounds of three blocks; each block runs the same steps in its own pipeline. write_us: time
    of one `write` (µs).
    """
    scene, data = Crossing(), payloads(DIFFERENT)
    pipelines = [Pipeline("balanced") for _ in range(3)]
    for pipeline in pipelines:
        pipeline.on_shapes(scene.shapes())
        for step in range(WARM):
            pipeline.on_states(scene.states(step))
    gc.collect()
    gc.freeze()  # as the node does
    durations = np.empty((rounds, 3))
    others = np.empty((rounds, 3))
    writing, written, recorded = 0.0, 0, 0.0
    recorder = Recorder(folder / "steps.mcap", TYPES, pipelines[0].metadata(), patient=False)
    spans, recorded_steps = watched(recorder), []
    takers: tuple[Recorder | Nobody | None, ...] = (None, Nobody(), recorder)
    for k in range(3 * rounds):
        arm = k % 3 if k // 3 % 2 else 2 - k % 3  # back and forth: drift affects all equally
        taker, sent, spent, in_block = takers[arm], 0, 0.0, []
        begin, busy = time.perf_counter(), _busy_elsewhere()
        for step in range(WARM + k // 3 * steps, WARM + (k // 3 + 1) * steps):
            states = scene.states(step)
            before = time.perf_counter()
            outputs = pipelines[arm].on_states(states)
            after = time.perf_counter()
            in_block.append(after - before)
            if taker is recorder:
                recorded_steps.append((before, after))
            assert outputs is not None
            if taker is not None:
                before = time.perf_counter()
                taker.write(STATES, states, step, step)
                taker.write(CONTACTS, outputs.contacts, step, step)
                taker.write(PREDICTIONS, outputs.predictions, step, step)
                sent += 3
                while sent < (before - begin) * RATE:
                    taker.write(STATES, data[sent % DIFFERENT], step, step)
                    sent += 1
                spent += time.perf_counter() - before
            time.sleep(0.0005)
        durations[k // 3, arm] = np.mean(in_block)
        others[k // 3, arm] = (_busy_elsewhere() - busy) / (time.perf_counter() - begin)
        if taker is recorder:
            writing, written, recorded = writing + spent, written + sent, recorded + time.perf_counter() - begin
            while recorder.status()["recorded_messages"] < written:
                time.sleep(0.05)  # messages that wait for the disk belong to this block
    recorder.close()
    assert recorder.status()["recording_dropped"] == 0
    off, calls, on = durations.T
    quiet = others.max(axis=1) < QUIET
    return {
        "step_ms": 1e3 * float(np.median(off)),
        "step_ms_recording": 1e3 * float(np.median(on)),
        "ratio": float(np.median(on / off)),
        "ratio_10_percent": float(np.quantile(on / off, 0.1)),
        "ratio_90_percent": float(np.quantile(on / off, 0.9)),
        "ratio_of_means": float(on.mean() / off.mean()),
        "beside_its_work": beside_its_work(recorded_steps, spans),
        "ratio_nobody": float(np.median(calls / off)),
        "ratio_to_nobody": float(np.median(on / calls)),
        "quiet_blocks": int(quiet.sum()),
        "ratio_quiet": float(np.median((on / off)[quiet])) if quiet.any() else float("nan"),
        "others_cores": float(np.median(others)),
        "write_us": 1e6 * writing / written,
        "messages_per_s": written / recorded,
    }


def _busy_elsewhere() -> float:
    """Processor time that all other processes of this machine have taken (s)."""
    with open("/proc/stat", encoding="ascii") as file:
        ticks = [int(each) for each in file.readline().split()[1:9]]
    idle, stolen = ticks[3] + ticks[4], ticks[7]
    return (sum(ticks) - idle - stolen) / os.sysconf("SC_CLK_TCK") - time.process_time()


def killed(folder: Path, times: int) -> dict[str, object]:
    """Time (s) lost by each of `times` processes that were killed while they recorded."""
    lost, recovered, holes = [], [], 0
    for k in range(times):
        path = folder / f"killed_{k}.mcap"
        child = subprocess.Popen([sys.executable, "-c", CHILD, path], stdout=subprocess.PIPE)
        assert child.stdout is not None
        child.stdout.readline()
        time.sleep(random.uniform(0.6, 2.0))
        at = time.time_ns()
        os.kill(child.pid, signal.SIGKILL)
        child.wait()
        messages = list(Session(path).messages())
        holes += [int.from_bytes(m.data[:8], "little") for m in messages] != list(range(len(messages)))
        lost.append((at - messages[-1].log_time) * 1e-9)
        recovered.append(len(messages))
        path.unlink()
    return {"lost_s": sorted(lost), "messages_recovered": recovered, "with_holes": holes}


def snapshot_cost(repeat: int = 50) -> dict[str, float]:
    """Cost of a snapshot of 200 objects: a step waits for the copy, and the recorder's thread packs it."""
    scene, pipeline = Crossing(), Pipeline("balanced")
    pipeline.on_shapes(scene.shapes())
    copying, packing, size = [], [], 0
    for step in range(repeat):
        pipeline.on_states(scene.states(step))
        begin = time.perf_counter()
        snapshot = pipeline.snapshot()
        copied = time.perf_counter()
        size = len(snapshot.encode())
        copying.append(copied - begin)
        packing.append(time.perf_counter() - copied)
    return {"copy_us": 1e6 * float(np.median(copying)), "pack_ms": 1e3 * float(np.median(packing)), "kB": size / 1e3}


def replay_speed(folder: Path, steps: int) -> dict[str, float]:
    """Speed of a replay in times real time: 200 objects at 50 Hz, one thread."""
    scene, pipeline = Crossing(), Pipeline("balanced")
    path = folder / "replay.mcap"
    with Recorder(path, TYPES, pipeline.metadata(), patient=True, snapshots=True) as recorder:
        shapes = scene.shapes()
        pipeline.on_shapes(shapes)
        recorder.write(SHAPES, shapes, 0, 0)
        for step in range(steps):
            states, now = scene.states(step), step * 20_000_000
            outputs = pipeline.on_states(states)
            assert outputs is not None
            recorder.write(STATES, states, now, now)
            recorder.write(CONTACTS, outputs.contacts, now, now)
            recorder.write(PREDICTIONS, outputs.predictions, now, now)
            if recorder.snapshot_due:
                recorder.write_snapshot(pipeline.snapshot())
    cpu = time.process_time()
    report = replay(Session(path))
    cpu = time.process_time() - cpu
    begin = time.perf_counter()
    late = replay(Session(path), start=report.recorded_duration - 1.0)
    return {
        "verdict": report.verdict.name.lower(),
        "times_real_time": report.speed,
        "times_real_time_by_processor": report.recorded_duration / cpu,
        "steps": report.steps,
        "file_MB": path.stat().st_size / 1e6,
        "snapshots": len(Session(path).timeline().snapshots),
        "last_second_s": time.perf_counter() - begin,
        "last_second_verdict": late.verdict.name.lower(),
        "last_second_same_digest": late.digest == report.digest,
    }


def main() -> None:
    """Run all measurements and print them, or one JSON object."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--quick", action="store_true", help="fewer repetitions")
    parser.add_argument("--folder", type=Path, help="folder on the disk to measure (default: the temporary folder)")
    parser.add_argument("--json", action="store_true", help="print one JSON object")
    args = parser.parse_args()
    with tempfile.TemporaryDirectory(dir=args.folder) as name:
        folder = Path(name)
        results: dict[str, dict[str, object]] = {
            "sustained": {**sustained(folder, 3 if args.quick else 20)},
            "step": {**step_cost(folder, ROUNDS[args.quick], 400)},
            "killed": killed(folder, 3 if args.quick else 20),
            "snapshot": {**snapshot_cost()},
            "replay": {**replay_speed(folder, 500 if args.quick else 3000)},
        }
    if args.json:
        print(json.dumps(results, indent=2))
        return
    s, step, kill, again, state = (results[name] for name in ("sustained", "step", "killed", "replay", "snapshot"))
    print(f"sustained  {s['messages_per_s']:9,.0f} messages/s of 1 kB, {s['MB_per_s']:.0f} MB/s, none dropped")
    print(
        f"step       {step['step_ms']:.3f} ms of {OBJECTS} boxes; {step['step_ms_recording']:.3f} ms beside "
        f"{step['messages_per_s']:,.0f} messages/s: ratio {step['ratio']:.3f} "
        f"({step['ratio_10_percent']:.3f} to {step['ratio_90_percent']:.3f}), {step['ratio_quiet']:.3f} in the "
        f"{step['quiet_blocks']} of {ROUNDS[args.quick]} rounds in which others took under {QUIET} cores, "
        f"{step['ratio_of_means']:.3f} of the means, {step['beside_its_work']:.3f} beside its work; "
        f"{step['ratio_nobody']:.3f} beside discarded messages, "
        f"{step['ratio_to_nobody']:.3f} from there to recording; {step['write_us']:.1f} µs for each write"
    )
    lost = kill["lost_s"]
    assert isinstance(lost, list)
    print(
        f"killed     {len(lost)} times: lost {np.median(lost):.3f} s in the median, {lost[-1]:.3f} s at most; "
        f"{kill['with_holes']} files with holes"
    )
    print(
        f"snapshot   copied in {state['copy_us']:.0f} µs, packed by the recorder in {state['pack_ms']:.1f} ms, "
        f"{state['kB']:.0f} kB"
    )
    print(
        f"replay     {again['times_real_time']:.0f} × real time, {OBJECTS} boxes at 50 Hz, "
        f"{again['times_real_time_by_processor']:.0f} × by processor time: {again['verdict']}; its last second, "
        f"from one of {again['snapshots']} snapshots in {again['file_MB']:.0f} MB: {again['last_second_s']:.2f} s, "
        f"{again['last_second_verdict']}"
    )


if __name__ == "__main__":
    main()
