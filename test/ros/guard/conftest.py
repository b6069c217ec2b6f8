"""The guard in its own process, and a planner and a base that talk to it over DDS."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import Twist, TwistStamped
from rclpy.qos import DurabilityPolicy, QoSProfile
from std_msgs.msg import String

from collision_monitor import records

RULES = Path(__file__).parents[3] / "config/guard_rules.yaml"
PROGRAM = "import sys; from collision_monitor.ros.executables import guard; sys.exit(guard())"


@pytest.fixture
def guard(ros_domain_id: int, tmp_path: Path) -> Iterator[Callable[..., subprocess.Popen[str]]]:
    """A function that starts a guard with parameters such as `robot:=cart`."""
    started: list[subprocess.Popen[str]] = []

    def start_guard(*arguments: str) -> subprocess.Popen[str]:
        command = [sys.executable, "-c", PROGRAM, "--ros-args", *(each for a in arguments for each in ("-p", a))]
        with (tmp_path / f"guard_{len(started)}.txt").open("w") as words:
            started.append(subprocess.Popen(command, stderr=words, text=True, env=dict(os.environ)))
        return started[-1]

    yield start_guard
    for process in started:  # one that is killed amid a flood leaves its peers with half a message
        process.send_signal(signal.SIGINT)
        with suppress(subprocess.TimeoutExpired):
            process.wait(5.0)
        process.kill()
        process.communicate()


class Base:
    """A planner and a base: sends commands and keeps what the guard passes, and what it says."""

    def __init__(self, team: Any, kind: type = Twist) -> None:
        self.team, self.kind = team, kind
        self.passed: list[Any] = []
        self.said: list[str] = []
        self.health: list[Any] = []
        self._out = team.node.create_publisher(kind, "/cmd_vel_in", 1)
        team.node.create_subscription(kind, "/cmd_vel_out", self.passed.append, 10)
        latched = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
        team.node.create_subscription(String, "/guard/state", lambda m: self.said.append(m.data), latched)
        team.node.create_subscription(DiagnosticArray, "/diagnostics", self._on_health, 10)

    def _on_health(self, array: Any) -> None:
        self.health += [each for each in array.status if each.name == "guard: guard"]

    def command(self, x: float, ahead: float = 0.0) -> Any:
        message = self.kind()
        if self.kind is TwistStamped:
            stamp = self.team.now + round(ahead * 1e9)
            message.header.stamp.sec, message.header.stamp.nanosec = stamp // 10**9, stamp % 10**9
            message.twist.linear.x = x
        else:
            message.linear.x = x
        return message

    def send(self, x: float) -> None:
        self._out.publish(self.command(x))

    def publish(self, message: Any) -> None:
        self._out.publish(message)

    def last(self) -> float:
        message = self.passed[-1]
        return float((message.twist if self.kind is TwistStamped else message).linear.x)

    def hears(self, words: str) -> bool:
        """Say whether the guard's newest state, if one has arrived, contains these words."""
        return bool(self.said) and words in self.said[-1]

    def drive(self, x: float, condition: Callable[[], Any], states: Any = None, timeout: float = 30.0) -> None:
        """Send commands, and states if there are any, until the condition holds."""
        self.drive_by(lambda: self.send(x), condition, states, timeout)

    def drive_by(
        self, send: Callable[[], Any], condition: Callable[[], Any], states: Any = None, timeout: float = 30.0
    ) -> None:
        def look() -> Any:
            send()
            if states is not None:
                self.team.say(*(states() if callable(states) else states))
            self.team.listen(0.03)
            return condition()

        try:
            self.team.until(look, timeout)
        except AssertionError:
            raise AssertionError(f"the guard said {self.said[-3:]}, and passed {self.passed[-1:]}") from None


@pytest.fixture
def base(team: Any) -> Base:
    return Base(team)


@pytest.fixture
def stamped_base(team: Any) -> Base:
    return Base(team, TwistStamped)


def row(object_id: int, x: float, y: float = 0.0) -> Any:
    state = np.zeros((), records.STATE)
    state["id"], state["quaternion"], state["position"] = object_id, (0, 0, 0, 1), (x, y, 0)
    return state
