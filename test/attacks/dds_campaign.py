"""Attacks on a node in its own process, over DDS on this machine, with the known scene between them."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, Final

import known_scene
import rclpy
from campaign import START, STEP, Failure
from message_fuzzer import hostile_message
from rclpy.executors import SingleThreadedExecutor
from visualization_msgs.msg import MarkerArray

from collision_monitor.codec import (
    ContactArray,
    PredictedCollisionArray,
    decode_contacts,
    decode_predictions,
    decode_status,
)
from collision_monitor.pipeline.topics import Topic
from collision_monitor.ros.domain import free_domain
from collision_monitor.ros.endpoints import quality_of
from collision_monitor_msgs import msg

BATCH: Final = 25
"""Attacks between two questions of the known scene."""

START_UP: Final = 180.0
"""s for a node to start, which may have to compile its kernels."""
ANSWER: Final = 10.0
"""s for an answer to the known scene. States are best effort and are repeated until then."""
AGAIN: Final = 0.3
"""s until unanswered states are sent again."""
LONGEST_SILENCE: Final = 3.0
"""s between two statuses. A node publishes one each 0.5 s, whatever happens."""
END: Final = 10.0
"""s for a node to end after a SIGINT."""

NODE_GROWTH: Final = 48e6
"""Bytes by which the node may grow after the first quarter of the attacks. Fast DDS keeps the last messages."""

SHORTEST: Final = 4
"""Bytes of the shortest message that the middleware transports: the encapsulation header."""


class Attacker:
    """Publishes bytes to a monitor and keeps its last answers."""

    def __init__(self) -> None:
        self._context = rclpy.Context()
        rclpy.init(context=self._context)
        self.node = rclpy.create_node("attacker", context=self._context)
        self._executor = SingleThreadedExecutor(context=self._context)
        self._executor.add_node(self.node)
        self.contacts: dict[int, ContactArray] = {}
        self.predictions: dict[int, PredictedCollisionArray] = {}
        self.now = START
        self.status: Any = None
        self.last_status = time.monotonic()
        self.silence = 0.0
        self._out = {
            Topic.SHAPES: self._publisher(msg.ObjectDescriptionArray, Topic.SHAPES),
            Topic.STATES: self._publisher(msg.ObjectStateArray, Topic.STATES),
        }
        self._subscribe(msg.ContactArray, Topic.CONTACTS, self._on_contacts)
        self._subscribe(msg.PredictedCollisionArray, Topic.PREDICTIONS, self._on_predictions)
        self._subscribe(msg.MonitorStatus, Topic.STATUS, self._on_status)
        self._subscribe(MarkerArray, Topic.MARKERS, lambda data: None)  # so that the node draws what it is sent

    def _publisher(self, kind: Any, topic: Topic) -> Any:
        return self.node.create_publisher(kind, topic.of(), quality_of(topic))

    def _subscribe(self, kind: Any, topic: Topic, callback: Callable[[bytes], None]) -> None:
        self.node.create_subscription(kind, topic.of(), callback, quality_of(topic), raw=True)

    def _on_contacts(self, data: bytes) -> None:
        message = decode_contacts(data)
        self.now = message.stamp_ns
        self.contacts = {**dict(list(self.contacts.items())[-8:]), message.stamp_ns: message}

    def _on_predictions(self, data: bytes) -> None:
        message = decode_predictions(data)
        self.predictions = {**dict(list(self.predictions.items())[-8:]), message.stamp_ns: message}

    def _on_status(self, data: bytes) -> None:
        self.status, now = decode_status(data), time.monotonic()
        self.silence, self.last_status = max(self.silence, now - self.last_status), now

    @property
    def is_connected(self) -> bool:
        """Whether the monitor receives both topics and its status arrives."""
        return self.status is not None and all(each.get_subscription_count() for each in self._out.values())

    def publish(self, topic: Topic, data: bytes) -> None:
        """Publish bytes. Settings have no topic; their bytes go to the states."""
        if len(data) >= SHORTEST:
            self._out.get(topic, self._out[Topic.STATES]).publish(data)

    def listen(self, seconds: float) -> None:
        """Receive for this long."""
        end = time.monotonic() + seconds
        while (left := end - time.monotonic()) > 0.0:
            self._executor.spin_once(timeout_sec=left)

    def ask(self, step: int, place: int) -> list[str]:
        """Ask for the known scene until there is an answer. Return what is wrong with it."""
        self.publish(Topic.SHAPES, known_scene.descriptions(0, snapshot=True))
        end, later = time.monotonic() + ANSWER, START
        while time.monotonic() < end:
            stamp = self.now + STEP
            if not 0 <= stamp // 1_000_000_000 < 2**31:
                later += STEP  # a later message has to confirm that the clock goes back
                stamp = later
            self.publish(Topic.STATES, known_scene.states(step, place, stamp))
            again = time.monotonic() + AGAIN
            while time.monotonic() < again:
                self._executor.spin_once(timeout_sec=0.02)
                contacts, predictions = self.contacts.get(stamp), self.predictions.get(stamp)
                if contacts is not None and predictions is not None:
                    wrong = known_scene.wrong(step, contacts, predictions)
                    if not wrong or set(contacts.ids.tolist()) >= known_scene.IDS:
                        return wrong
                    break  # answered before the scene was described; the states come on another topic
        return wrong if "wrong" in locals() else [f"no answer to the known scene in {ANSWER} s"]

    def close(self) -> None:
        """Leave the domain."""
        self._executor.shutdown()
        self.node.destroy_node()
        rclpy.shutdown(context=self._context)


@contextmanager
def running_node(folder: Path, *arguments: str) -> Iterator[tuple[subprocess.Popen[bytes], Path]]:
    """Start a monitor in the present ROS domain. Yield its process and the file with its output."""
    folder.mkdir(parents=True, exist_ok=True)
    log = folder / "node.log"
    command = [sys.executable, "-m", "collision_monitor", "run", *arguments]
    with log.open("wb") as output:
        process = subprocess.Popen(command, stdin=subprocess.DEVNULL, stdout=output, stderr=output, cwd=folder)
        try:
            yield process, log
        finally:
            if process.poll() is None:
                process.kill()
                process.wait()


def memory_of(pid: int) -> int:
    """Return the resident memory of a process (bytes)."""
    return int(Path(f"/proc/{pid}/statm").read_text().split()[1]) * os.sysconf("SC_PAGESIZE")


def attack_node(
    seed: int, messages: int, rate: float, folder: Path | None = None, done: Callable[[int], None] = lambda n: None
) -> dict[str, Any]:
    """Attack a node in the present ROS domain with messages at a rate (Hz). Return the report."""
    os.environ.setdefault("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
    if "ROS_DOMAIN_ID" not in os.environ:
        os.environ["ROS_DOMAIN_ID"] = str(free_domain())
    folder = Path(tempfile.mkdtemp()) if folder is None else folder
    report: dict[str, Any] = {"messages": 0, "known answers": 0, "failures": [], "problems": []}
    with running_node(folder) as (process, log):
        attacker = Attacker()
        try:
            _attack(attacker, process, seed, messages, rate, report, done)
            _end(process, report)
        finally:
            attacker.close()
        report["longest time without status"] = f"{attacker.silence:.2f} s"
        if "Traceback" in log.read_text():
            report["problems"].append(f"the node printed a traceback, see {log}")
    if report["problems"]:
        last = report.pop("last")
        failure = Failure(seed, last, "\n".join(report["problems"]), "", "")
        report["failures"] = [str(failure.save(folder))]
    report.pop("last", None)
    return report


def _attack(
    attacker: Attacker,
    process: subprocess.Popen[bytes],
    seed: int,
    messages: int,
    rate: float,
    report: dict[str, Any],
    done: Callable[[int], None],
) -> None:
    problems: list[str] = report["problems"]
    end = time.monotonic() + START_UP
    while not attacker.is_connected:
        attacker.listen(0.05)
        if time.monotonic() > end or process.poll() is not None:
            problems.append("the node did not start")
            report["last"] = 0
            return
    attacker.listen(0.2)  # the discovery by the monitor has no count that is visible here
    attacker.silence = 0.0
    settled = memory_of(process.pid)
    for index in range(messages):
        report["last"] = index
        message = hostile_message(seed, index, attacker.now)
        attacker.publish(message.topic, message.data)
        report["messages"] += 1
        attacker.listen(1.0 / rate)
        if (index + 1) % BATCH == 0 or index + 1 == messages:
            problems += attacker.ask(index // BATCH, index // BATCH)
            if process.poll() is not None:
                problems.append(f"the node ended with {process.returncode}")
            if attacker.silence > LONGEST_SILENCE:
                problems.append(f"the node published no status for {attacker.silence:.1f} s")
            if problems:
                return
            report["known answers"] += 1
            if index < messages // 4:
                settled = memory_of(process.pid)
            done(BATCH)
    growth = memory_of(process.pid) - settled
    report["memory of the node"] = f"{memory_of(process.pid) / 1e6:.0f} MB, {growth / 1e6:+.1f} MB since a quarter"
    if growth > NODE_GROWTH:
        problems.append(f"the node grew by {growth / 1e6:.1f} MB")


def _end(process: subprocess.Popen[bytes], report: dict[str, Any]) -> None:
    if process.poll() is not None:
        return
    process.send_signal(signal.SIGINT)
    try:
        code = process.wait(END)
        if code:
            report["problems"].append(f"the node ended with {code} after a SIGINT")
    except subprocess.TimeoutExpired:
        report["problems"].append(f"the node did not end within {END} s of a SIGINT")
