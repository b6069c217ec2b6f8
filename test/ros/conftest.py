"""A monitor in its own process, and a team of robots that talks to it over DDS."""

from __future__ import annotations

import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import rclpy
from rclpy.executors import SingleThreadedExecutor
from rclpy.qos import QoSProfile

from collision_monitor import codec, records
from collision_monitor.codec import Change
from collision_monitor.pipeline.topics import Topic
from collision_monitor.ros.endpoints import quality_of
from collision_monitor_msgs.msg import (
    ContactArray,
    MonitorStatus,
    ObjectDescriptionArray,
    ObjectStateArray,
    PredictedCollisionArray,
)

START = 60.0
"""s for a process to answer; the first one on a machine may have to compile its kernels."""


class Process:
    """A `collision-monitor` command."""

    def __init__(self, folder: Path, *arguments: str) -> None:
        self._words = (folder / f"words_{time.monotonic_ns()}").open("w+")
        self._process = subprocess.Popen(
            [sys.executable, "-m", "collision_monitor", *arguments],
            stdin=subprocess.DEVNULL,
            stdout=self._words,
            stderr=self._words,
            cwd=folder,
        )

    def send(self, number: signal.Signals) -> None:
        self._process.send_signal(number)

    def wait(self, timeout: float = START) -> int:
        return self._process.wait(timeout)

    def stop(self, number: signal.Signals = signal.SIGINT) -> int:
        """Return the exit code."""
        self.send(number)
        return self.wait(15.0)

    @property
    def pid(self) -> int:
        return self._process.pid

    @property
    def running(self) -> bool:
        return self._process.poll() is None

    @property
    def words(self) -> str:
        """The output so far, of both streams."""
        self._words.flush()
        return Path(self._words.name).read_text()

    def kill(self) -> None:
        if self.running:
            self._process.kill()
            self._process.wait()
        self._words.close()


class Team:
    """Publishes shapes and states, and keeps every answer. rclpy itself reads the messages, not our codec."""

    def __init__(self) -> None:
        self._context = rclpy.Context()
        rclpy.init(context=self._context)
        self.node = rclpy.create_node("team", context=self._context)
        self._executor = SingleThreadedExecutor(context=self._context)
        self._executor.add_node(self.node)
        self.contacts: list[Any] = []
        self.predictions: list[Any] = []
        self.statuses: list[Any] = []
        self._shapes_out = self.publisher(ObjectDescriptionArray, "objects/shapes", quality_of(Topic.SHAPES))
        self._states_out = self.publisher(ObjectStateArray, "objects/states", quality_of(Topic.STATES))
        self._contacts_in = self._subscribe(ContactArray, "contacts", quality_of(Topic.CONTACTS), self.contacts)
        self._subscribe(PredictedCollisionArray, "predictions", quality_of(Topic.PREDICTIONS), self.predictions)
        self._subscribe(MonitorStatus, "status", quality_of(Topic.STATUS), self.statuses)

    def publisher(self, message: Any, topic: str, quality: QoSProfile) -> Any:
        return self.node.create_publisher(message, f"/object_monitor/{topic}", quality)

    def _subscribe(self, message: Any, topic: str, quality: QoSProfile, kept: list[Any]) -> Any:
        return self.node.create_subscription(message, f"/object_monitor/{topic}", kept.append, quality)

    def stop_reading_contacts(self) -> None:
        """Unsubscribe from the contacts."""
        self.node.destroy_subscription(self._contacts_in)
        self.listen(0.5)  # until the monitor has noticed

    def until(self, condition: Callable[[], Any], timeout: float = 10.0) -> None:
        """Listen until the condition holds; otherwise fail and show the last status."""
        deadline = time.monotonic() + timeout
        while not condition():
            assert time.monotonic() < deadline, f"expected the condition to hold in time; {self.statuses[-1:]}"
            self._executor.spin_once(timeout_sec=0.05)

    def listen(self, seconds: float) -> None:
        deadline = time.monotonic() + seconds
        while time.monotonic() < deadline:
            self._executor.spin_once(timeout_sec=0.05)

    def settle(self, quiet: float = 1.2) -> None:
        """Listen until the monitor lives and has made no step for so long (s): longer than the period of the status."""
        steps: list[int] = []

        def is_quiet() -> bool:
            heard = len(self.statuses)
            self.listen(quiet)
            steps.append(self.statuses[-1].step)
            return len(self.statuses) > heard and len(steps) > 1 and steps[-1] == steps[-2]

        self.until(is_quiet, START)

    def meet(self) -> None:
        """Wait until the monitor and the team have discovered each other."""
        self.until(
            lambda: (
                self.statuses
                and self._states_out.get_subscription_count()
                and self.node.count_publishers("/object_monitor/predictions")
            ),
            START,
        )
        self.listen(0.2)  # the discovery by the monitor has no count that is visible here

    @property
    def now(self) -> int:
        return self.node.get_clock().now().nanoseconds

    def describe(self, *objects: Change, snapshot: bool = False) -> None:
        self._shapes_out.publish(codec.encode_descriptions(self.now, "world", objects, snapshot=snapshot))

    def publish_states(self, data: bytes) -> None:
        self._states_out.publish(data)

    def publish_shapes(self, data: bytes) -> None:
        self._shapes_out.publish(data)

    def say(self, *rows: np.void, stamp: int | None = None, frame_id: str = "world") -> int:
        """Publish states and return their stamp."""
        stamp = self.now if stamp is None else stamp
        states = np.stack(rows) if rows else np.zeros(0, records.STATE)
        self._states_out.publish(codec.encode_states(stamp, frame_id, 0, states))
        return stamp

    def ask(self, *rows: np.void, stamp: int | None = None) -> tuple[Any, Any]:
        """Publish states and return their answers: ContactArray and PredictedCollisionArray."""
        stamp = self.say(*rows, stamp=stamp)
        self.until(lambda: self._of(self.contacts, stamp) and self._of(self.predictions, stamp))
        return self._of(self.contacts, stamp)[0], self._of(self.predictions, stamp)[0]

    @staticmethod
    def _of(messages: list[Any], stamp: int) -> list[Any]:
        return [m for m in messages if m.header.stamp.sec * 1_000_000_000 + m.header.stamp.nanosec == stamp]

    def status(self, condition: Callable[[Any], Any]) -> Any:
        """Return the first status from now on for which the condition holds."""
        self.until(lambda: self.statuses and condition(self.statuses[-1]))
        return self.statuses[-1]

    def close(self) -> None:
        self._executor.shutdown()
        self.node.destroy_node()
        rclpy.shutdown(context=self._context)


@pytest.fixture
def start(ros_domain_id: int, tmp_path: Path) -> Iterator[Callable[..., Process]]:
    """Yield a function that starts `collision-monitor` in an empty folder. Kill the processes at the end."""
    started: list[Process] = []

    def start_process(*arguments: str) -> Process:
        started.append(Process(tmp_path, *arguments))
        return started[-1]

    yield start_process
    for process in started:
        process.kill()


@pytest.fixture
def signals() -> Iterator[None]:
    """Restore the handlers that a main function takes over."""
    kept = {number: signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM)}
    yield
    for number, handler in kept.items():
        signal.signal(number, handler)


@pytest.fixture
def team(ros_domain_id: int) -> Iterator[Team]:
    team = Team()
    yield team
    team.close()
