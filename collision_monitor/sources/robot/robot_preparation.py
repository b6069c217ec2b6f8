"""Robots whose URDF or meshes take long are made beside the monitoring, as models of objects are."""

from __future__ import annotations

import os
import pickle
import signal
import subprocess
import sys
import threading
from collections.abc import Mapping
from pathlib import Path
from typing import Final

from collision_monitor.pipeline.model_worker import ENVIRONMENT, JOB, LIMIT_BYTES, receive, send
from collision_monitor.robots.robot import Description, Robot

ROBOT_LIMIT_S: Final = 120.0
"""s for one robot, with all of its meshes. Beyond it, the robot is not monitored, which is listed."""

_COMMAND: Final = (sys.executable, "-m", "collision_monitor.sources.robot.robot_worker")


class RobotPreparation:
    """Makes robots in processes of their own, each waited for by a thread. limit: s for each."""

    def __init__(self, limit: float = ROBOT_LIMIT_S) -> None:
        self._limit = limit
        self._lock = threading.Lock()
        self._running: dict[str, subprocess.Popen[bytes]] = {}
        self._ended: dict[str, Robot | str] = {}
        self._closed = False

    def start(self, name: str, urdf: Description, srdf: Description | None, packages: Mapping[str, Path]) -> None:
        """Begin to make the robot of a line of the file. An earlier job of the line is dropped."""
        job = JOB.pack(self._limit, 0) + pickle.dumps((urdf, srdf, dict(packages)))
        with self._lock:
            self._stop(name)
            self._ended.pop(name, None)
            if self._closed:
                return
            path = os.pathsep.join(each for each in sys.path if each)
            process = subprocess.Popen(
                _COMMAND,
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                env={**os.environ, **ENVIRONMENT, "PYTHONPATH": path},
            )
            self._running[name] = process
        threading.Thread(target=self._wait, args=(name, process, job), name="robot", daemon=True).start()

    def ended(self, name: str) -> Robot | str | None:
        """Return the robot of a line, or why there is none; None while it is being made. It is returned once."""
        with self._lock:
            return self._ended.pop(name, None)

    @property
    def is_busy(self) -> bool:
        """Whether a robot is being made, or waits to be taken."""
        with self._lock:
            return bool(self._running or self._ended)

    def close(self) -> None:
        """End all processes."""
        with self._lock:
            self._closed = True
            for name in list(self._running):
                self._stop(name)

    def _stop(self, name: str) -> None:
        process = self._running.pop(name, None)
        if process is not None:
            process.kill()

    def _wait(self, name: str, process: subprocess.Popen[bytes], job: bytes) -> None:
        """The thread's side."""
        assert process.stdin is not None and process.stdout is not None
        result: Robot | str
        try:
            with process.stdin, process.stdout:
                send(process.stdin, job)
                result = pickle.loads(receive(process.stdout))
            process.wait()
        except (OSError, EOFError, pickle.UnpicklingError):
            code = process.wait()
            result = f"the process that makes the robot ended ({code}; its limit is {LIMIT_BYTES >> 30} GiB)"
            if code == -signal.SIGALRM:
                result = f"to make the robot takes longer than {self._limit:g} s"
        with self._lock:
            if self._running.get(name) is process:  # no later job of this line
                del self._running[name]
                self._ended[name] = result
