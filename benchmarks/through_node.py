"""Measure the time from a state's stamp to the arrival of its predictions, through DDS.

    python benchmarks/through_node.py                                    1,000 at 100 Hz and 10,000 at 20 Hz, 60 s each
    python benchmarks/through_node.py --objects 500 --rate 50 --duration 10 --scene particles

The world and the recording monitor are the commands `world` and `run`, each in its own process; this process listens.
All traffic stays on this machine, in a ROS domain of its own. The exit code is 1 if nothing could be measured.
"""

from __future__ import annotations

import argparse
import dataclasses
import gc
import json
import os
import platform
import re
import sys
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from collision_monitor import codec
from collision_monitor._version import VERSION
from collision_monitor.cli.child import Child, ProcessError
from collision_monitor.codec.cdr import Reader
from collision_monitor.errors import CollisionMonitorError, InputError
from collision_monitor.ros.domain import free_domain
from collision_monitor.ros.process import ros_context, stay_on_this_machine
from collision_monitor.world import describe

CASES = ((1_000, 100.0), (10_000, 20.0))
"""Default pairs of moving objects and messages per second."""
START_PATIENCE = 180.0
"""s to wait for the monitor's first status; after a change it compiles its kernels first."""
STRAGGLERS = 1.0
"""s to wait for the last answers after the world has ended."""
TICK = 0.25
"""s between two checks of the processes."""
PUBLISHED = re.compile(r"published (\d+) messages in .* s, (\d+) periods skipped, at most ([0-9.]+) ms after")


@dataclass(frozen=True)
class Measurement:
    """Times in ms, memory in MB. load: mean number of runnable processes in the last minute, before and after."""

    scene: str
    objects: int
    rate: float
    duration: float
    published: int
    periods_skipped: int
    published_late_max: float
    states_lost: int
    answered: int
    answers_lost: int
    latency_median: float
    latency_p99: float
    latency_max: float
    step_p99: float
    contacts: int
    predictions: int
    recorded: int
    recording_dropped: int
    node_cpu_percent: float
    memory_start: float
    memory_end: float
    load: tuple[float, float]

    @property
    def dropped(self) -> int:
        """Number of published states without an answer."""
        return self.published - self.answered


class Listener:
    """Notes the step, the stamp and the arrival of each answer, and decodes nothing else."""

    def __init__(self) -> None:
        from rclpy import create_node
        from rclpy.executors import SingleThreadedExecutor

        from collision_monitor.pipeline.topics import Topic
        from collision_monitor.ros.endpoints import subscription

        self.arrivals: list[tuple[int, int, int]] = []  # step, stamp and arrival in ns of the system's clock
        self._status: bytes | None = None
        self._node = create_node("through_node")
        subscription(self._node, Topic.PREDICTIONS, self._on_predictions, Topic.PREDICTIONS.of())
        subscription(self._node, Topic.STATUS, self._on_status, Topic.STATUS.of())
        self._executor = SingleThreadedExecutor()
        self._executor.add_node(self._node)

    def _on_predictions(self, data: bytes) -> None:
        arrived = time.time_ns()
        reader = Reader(data, "PredictedCollisionArray")
        stamp = reader.stamp_ns()
        reader.string("header.frame_id")
        self.arrivals.append((reader.scalar("u8", "step"), stamp, arrived))

    def _on_status(self, data: bytes) -> None:
        self._status = data

    @property
    def status(self) -> codec.MonitorStatus | None:
        """The newest status, or None."""
        return None if self._status is None else codec.decode_status(self._status)

    def listen(self, seconds: float) -> None:
        """Receive messages for so many seconds."""
        until = time.monotonic() + seconds
        while (left := until - time.monotonic()) > 0.0:
            self._executor.spin_once(timeout_sec=left)

    def close(self) -> None:
        """Leave ROS."""
        self._executor.shutdown()
        self._node.destroy_node()


def measure(scene: str, objects: int, rate: float, duration: float, seed: int) -> Measurement:
    """Play the scene once. Raises ProcessError if a process fails or no answer arrives."""
    load = os.getloadavg()[0]
    with (
        tempfile.TemporaryDirectory() as folder,
        Child("run", "--record", str(Path(folder) / "session.mcap")) as monitor,
        ros_context([]),
    ):
        listener = Listener()
        _wait_for_answer(listener, monitor)
        play = ["world", scene, "--objects", str(objects), "--rate", str(rate), "--duration", str(duration)]
        with Child(*play, "--seed", str(seed)) as world:
            gc.collect()
            gc.freeze()  # else garbage collection delays the listener
            while not listener.arrivals and world.running():
                listener.listen(TICK)
            began, cpu, memory = time.monotonic(), _cpu_seconds(monitor.pid), _memory(monitor.pid)
            while world.running() and monitor.running():
                listener.listen(TICK)
            played = time.monotonic() - began
            cpu, memory_end = _cpu_seconds(monitor.pid) - cpu, _memory(monitor.pid)
            listener.listen(STRAGGLERS)
            said = PUBLISHED.search(world.words())
        monitor.finish()
        listener.listen(TICK)  # the last status
        status = listener.status
        listener.close()
    if said is None or status is None or not listener.arrivals:
        raise ProcessError(f"expected states and answers, got {len(listener.arrivals)} answers: too short to measure")
    step, stamp, arrived = np.array(listener.arrivals).T
    latency = (arrived - stamp) * 1e-6
    return Measurement(
        scene=scene,
        objects=objects,
        rate=rate,
        duration=duration,
        published=int(said[1]),
        periods_skipped=int(said[2]),
        published_late_max=float(said[3]),
        states_lost=status.messages_lost,
        answered=len(np.unique(step)),
        answers_lost=status.step - len(np.unique(step)),
        latency_median=float(np.median(latency)),
        latency_p99=float(np.percentile(latency, 99)),
        latency_max=float(latency.max()),
        step_p99=status.step_duration_p99 * 1e3,
        contacts=status.contacts,
        predictions=status.predictions,
        recorded=status.recorded_messages,
        recording_dropped=status.recording_dropped,
        node_cpu_percent=100.0 * cpu / played,
        memory_start=memory,
        memory_end=memory_end,
        load=(load, os.getloadavg()[0]),
    )


def _wait_for_answer(listener: Listener, monitor: Child) -> None:
    """Wait for the first status, which the monitor publishes as soon as it listens."""
    patience = time.monotonic() + START_PATIENCE
    while listener.status is None:
        listener.listen(TICK)
        monitor.running()
        if time.monotonic() > patience:
            raise ProcessError(f"collision-monitor run: expected a status within {START_PATIENCE:g} s, got none")


def _cpu_seconds(pid: int) -> float:
    """User and system time of all threads in s (proc(5), stat: fields 14 and 15)."""
    fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def _memory(pid: int) -> float:
    """Physical memory (MB)."""
    return int(Path(f"/proc/{pid}/statm").read_text().split()[1]) * os.sysconf("SC_PAGE_SIZE") / 1e6


def table(measurements: list[Measurement]) -> str:
    """Text table with a column for each measurement."""
    rows = [("", [f"{m.scene}, {m.objects:,} at {m.rate:g} Hz" for m in measurements])]

    def row(name: str, texts: list[str]) -> None:
        rows.append((name, texts))

    row("latency median / p99 / max [ms]", [
        f"{m.latency_median:.1f} / {m.latency_p99:.1f} / {m.latency_max:.1f}" for m in measurements
    ])  # fmt: skip
    row("states published / answered / dropped", [f"{m.published} / {m.answered} / {m.dropped}" for m in measurements])
    row("lost on the way in / out", [f"{m.states_lost} / {m.answers_lost}" for m in measurements])
    row("periods the world skipped", [str(m.periods_skipped) for m in measurements])
    row("published at most late [ms]", [f"{m.published_late_max:.1f}" for m in measurements])
    row("step p99 in the node [ms]", [f"{m.step_p99:.1f}" for m in measurements])
    row("touching / predicted at the end", [f"{m.contacts} / {m.predictions}" for m in measurements])
    row("messages recorded / dropped", [f"{m.recorded} / {m.recording_dropped}" for m in measurements])
    row("node CPU [% of one core]", [f"{m.node_cpu_percent:.0f}" for m in measurements])
    row("node memory start / end [MB]", [f"{m.memory_start:.0f} / {m.memory_end:.0f}" for m in measurements])
    row("machine load before / after", [f"{m.load[0]:.1f} / {m.load[1]:.1f}" for m in measurements])
    first = max(len(name) for name, _ in rows)
    widths = [max(len(texts[i]) for _, texts in rows) for i in range(len(measurements))]
    return "\n".join(
        f"{name:{first}}" + "".join(f"  {text:>{width}}" for text, width in zip(texts, widths, strict=True))
        for name, texts in rows
    )


def main() -> int:
    """Return the exit code."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--objects", type=int, metavar="N", help="number of moving objects")
    parser.add_argument("--rate", type=float, metavar="HZ", help="messages per second")
    parser.add_argument("--duration", type=float, default=60.0, metavar="S", help="seconds each (default: 60)")
    parser.add_argument("--scene", default="clutter", metavar="NAME", help="see `world --list` (default: clutter)")
    parser.add_argument("--seed", type=int, default=1, metavar="K", help="seed of the scene (default: 1)")
    parser.add_argument("--json", action="store_true", help="print one line of JSON in place of the table")
    args = parser.parse_args()
    if (args.objects is None) != (args.rate is None):
        parser.error("--objects and --rate: expected both or neither")
    cases = CASES if args.objects is None else ((args.objects, args.rate),)
    try:
        describe(args.scene)
        if not args.duration > 0.0:
            raise InputError(f"--duration: expected a positive number of seconds, got {args.duration}")
        os.environ["ROS_AUTOMATIC_DISCOVERY_RANGE"] = "LOCALHOST"
        stay_on_this_machine()
        os.environ["ROS_DOMAIN_ID"] = str(free_domain())
        measurements = [measure(args.scene, n, rate, args.duration, args.seed) for n, rate in cases]
    except CollisionMonitorError as error:
        print(f"through_node: error: {error}", file=sys.stderr)
        return 1
    if args.json:
        about = {"version": VERSION, "python": platform.python_version(), "cpus": os.cpu_count()}
        results = [{**dataclasses.asdict(m), "dropped": m.dropped} for m in measurements]
        print(json.dumps({**about, "measurements": results}))
    else:
        print(table(measurements))
    return 0


if __name__ == "__main__":
    sys.exit(main())
