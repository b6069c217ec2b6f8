"""A `collision-monitor` command that runs in its own process."""

from __future__ import annotations

import ctypes
import os
import signal
import subprocess
import sys
import tempfile
from types import TracebackType

from collision_monitor.errors import CollisionMonitorError, one_line

LINES = 8
"""Last lines of the process's output that an error shows."""
PATIENCE = 10.0
"""Time from the request to stop until the process is killed (s)."""


PR_SET_PDEATHSIG = 1
"""Option of prctl (<linux/prctl.h>) that sets the signal a process gets when its parent ends for any reason."""
_prctl = getattr(ctypes.CDLL(None), "prctl", None)  # looked up here because few calls are safe between fork and exec


def _end_with_parent() -> None:
    """Make this new process stop, as by Ctrl-C, if its parent is killed. Runs between fork and exec."""
    if _prctl is not None:
        _prctl(PR_SET_PDEATHSIG, signal.SIGINT)


class ProcessError(CollisionMonitorError):
    """A process failed. The text ends with the last lines of its output."""

    def __str__(self) -> str:
        return "\n".join(map(one_line, str(self.args[0]).split("\n")))


class Child:
    """A process that runs until `finish`. The end of the `with` block kills it if it still runs."""

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
        """Process id."""
        return self._process.pid

    def words(self) -> str:
        """Return what the process has written to stdout and stderr so far."""
        file = self._words.fileno()  # pread, because the process shares the file offset
        return os.pread(file, os.fstat(file).st_size, 0).decode(errors="replace")

    def running(self) -> bool:
        """Return whether the process still runs. Raises ProcessError if it failed."""
        code = self._process.poll()
        if code:
            raise self._error(f"exit code {code}")
        return code is None

    def finish(self) -> None:
        """Ask the process to stop and wait. Raises ProcessError if it does not stop or if its exit code is not 0."""
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
