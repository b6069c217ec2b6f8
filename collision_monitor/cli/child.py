"""A `collision-monitor` command in a process of its own."""

from __future__ import annotations

import ctypes
import os
import signal
import subprocess
import sys
import tempfile
from types import TracebackType

from collision_monitor.errors import CollisionMonitorError

LINES = 8
"""Of the process's last words, in an error."""
PATIENCE = 10.0
"""s from the request to stop until the process is killed."""


PR_SET_PDEATHSIG = 1
"""From <linux/prctl.h>: the signal that this process gets when its parent ends, however that ends."""
_prctl = getattr(ctypes.CDLL(None), "prctl", None)  # looked up here: little may be done between fork and exec


def _end_with_parent() -> None:
    """In the new process, before it becomes another program: let it stop as by Ctrl-C where its parent is killed."""
    if _prctl is not None:
        _prctl(PR_SET_PDEATHSIG, signal.SIGINT)


class ProcessError(CollisionMonitorError):
    """A process that failed; the text ends with its own last words."""


class Child:
    """Runs until `finish`; killed where a `with` block is left before."""

    def __init__(self, *arguments: str) -> None:
        self._name = arguments[0]
        self._words = tempfile.TemporaryFile()  # noqa: SIM115 - closed in __exit__
        self._process = subprocess.Popen(
            [sys.executable, "-m", "collision_monitor", *arguments],
            stdin=subprocess.DEVNULL,
            stdout=self._words,
            stderr=self._words,
            preexec_fn=_end_with_parent,
        )

    @property
    def pid(self) -> int:
        """Of the process."""
        return self._process.pid

    def words(self) -> str:
        """What it has printed so far, both streams."""
        file = self._words.fileno()  # pread, because the process shares our place in the file
        return os.pread(file, os.fstat(file).st_size, 0).decode(errors="replace")

    def running(self) -> bool:
        """Raises ProcessError where it has failed."""
        code = self._process.poll()
        if code:
            raise self._error(f"exit code {code}")
        return code is None

    def finish(self) -> None:
        """Ask it to stop, and wait. Raises ProcessError where it does not stop or does so with an exit code."""
        if self._process.poll() is None:
            self._process.send_signal(signal.SIGINT)
        try:
            self._process.wait(PATIENCE)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()
            raise self._error(f"did not stop within {PATIENCE:g} s and was killed") from None
        self.running()

    def _error(self, what: str) -> ProcessError:
        lines = self.words().splitlines()[-LINES:]
        said = "".join(f"\n  {line}" for line in lines) or " nothing"
        return ProcessError(f"collision-monitor {self._name}: {what}; it said:{said}")

    def __enter__(self) -> Child:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if self._process.poll() is None:
            self._process.kill()
            self._process.wait()
        self._words.close()
