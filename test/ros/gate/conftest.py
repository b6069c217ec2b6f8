"""The gate in its own process, and a controller and a world that talk to it over DDS."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import suppress
from pathlib import Path

import pytest

PROGRAM = "import sys; from collision_monitor.ros.executables import gate; sys.exit(gate())"


@pytest.fixture
def gate(ros_domain_id: int, tmp_path: Path) -> Iterator[Callable[..., subprocess.Popen[str]]]:
    """A function that starts a gate with parameters such as `robot:=cart`."""
    started: list[subprocess.Popen[str]] = []

    def start_gate(*arguments: str) -> subprocess.Popen[str]:
        command = [sys.executable, "-c", PROGRAM, "--ros-args", *(each for a in arguments for each in ("-p", a))]
        with (tmp_path / f"gate_{len(started)}.txt").open("w") as words:
            started.append(subprocess.Popen(command, stderr=words, text=True, env=dict(os.environ)))
        return started[-1]

    yield start_gate
    for process in started:
        process.send_signal(signal.SIGINT)
        with suppress(subprocess.TimeoutExpired):
            process.wait(5.0)
        process.kill()
        process.communicate()
