"""Notices when a kernel is compiled rather than loaded from the cache, says how far that is, or prevents it."""

from __future__ import annotations

import logging
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from typing import Any, Final

from numba.core import event

FUNCTIONS: Final = {"monitor": 590, "options": 260, "functions": 75, "contact": 230}
"""About how many functions the parts of a warm-up compile, the last one after the first; and a first `contact`."""

_TEXT: Final = (
    "compiling the kernels of the first calls, once for this machine and version; "
    "`collision-monitor warm-up` compiles all in advance"
)


class CompilationProgress(event.Listener):
    """How far a compilation of many functions is. show: called when one begins; hide: when none is compiled any more.

    total: about how many there are.
    """

    def __init__(self, total: int, show: Callable[[], None], hide: Callable[[], None] = lambda: None) -> None:
        self._total, self._show, self._hide = total, show, hide
        self._depth = self._done = 0
        self._seconds = self._began = 0.0

    def on_start(self, event: Any) -> None:
        """Count a function that begins, maybe inside of another one."""
        if not self._depth:
            self._began = time.monotonic()
        self._depth += 1
        self._show()

    def on_end(self, event: Any) -> None:
        """Count a function that is compiled."""
        self._depth -= 1
        self._done += 1
        if not self._depth:
            self._seconds += time.monotonic() - self._began
            self._hide()

    @property
    def part(self) -> float:
        """Part of the functions that is compiled; never quite 1, because their number is not exact."""
        return min(self._done / self._total, 0.99)

    @property
    def left(self) -> str:
        """Part that is done, and the time left, as words."""
        seconds = self._seconds + (time.monotonic() - self._began if self._depth else 0.0)
        about = f", about {seconds * (1.0 - self.part) / self.part:.0f} s left" if self._done > 10 else ""
        return f"{100.0 * self.part:.0f} %{about}"


class Announcement(event.Listener):
    """Says once, in the log and in a terminal, that calls take long because kernels are compiled, and how far that is.

    Programs that say so themselves do it with `telling_compilation`.
    """

    is_made = False

    def __init__(self) -> None:
        self._progress: CompilationProgress | None = None

    def on_start(self, event: Any) -> None:
        """Announce the first compilation of this package, and show how far it is."""
        is_ours = event.data["dispatcher"].py_func.__module__.startswith("collision_monitor.")
        if is_ours and not Announcement.is_made:
            Announcement.is_made = True
            logging.getLogger("collision_monitor").info(_TEXT)
            if _is_plain_terminal():
                print(f"collision_monitor: {_TEXT}", file=sys.stderr, flush=True)
                part = "monitor" if "collision_monitor.monitor.monitor" in sys.modules else "contact"
                self._progress = CompilationProgress(FUNCTIONS[part], self._draw, self._erase)
        if self._progress is not None:
            self._progress.on_start(event)

    def on_end(self, event: Any) -> None:
        """Erase the bar with the last function."""
        if self._progress is not None:
            self._progress.on_end(event)

    def _draw(self) -> None:
        assert self._progress is not None
        width = round(20 * self._progress.part)
        bar = "#" * width + "-" * (20 - width)
        print(f"\r\033[K  compiling [{bar}] {self._progress.left}", end="", file=sys.stderr, flush=True)

    def _erase(self) -> None:
        print("\r\033[K", end="", file=sys.stderr, flush=True)


def _is_plain_terminal() -> bool:
    """Whether stderr is a terminal in which no other bar is drawn."""
    stream = sys.__stderr__
    return stream is not None and stream is sys.stderr and stream.isatty()


@contextmanager
def listening(listener: Any) -> Iterator[None]:
    """Let the listener hear of each compilation within the block. Nothing else announces them meanwhile."""
    before, Announcement.is_made = Announcement.is_made, True
    try:
        with event.install_listener("numba:compile", listener):
            yield
    finally:
        Announcement.is_made = before


@contextmanager
def telling_compilation(say: Callable[[str], None], total: int, every: float) -> Iterator[None]:
    """Say when the first kernel is compiled within the block, and then every so many seconds how far it is.

    total: about how many functions it compiles.
    """
    said_at = -1.0

    def show() -> None:
        nonlocal said_at
        now = time.monotonic()
        if said_at < 0.0:
            say("compiling the kernels, once for this machine and version")
        elif now - said_at >= every:
            say(f"compiling the kernels: {progress.left}")
        else:
            return
        said_at = now

    progress = CompilationProgress(total, show)
    with listening(progress):
        yield


class _NotCompiledError(Exception):
    """A kernel is not in the cache."""


@contextmanager
def compiling_nothing() -> Iterator[None]:
    """Load the kernels that the block calls, and leave it at the first one that would have to be compiled."""

    def leave() -> None:
        raise _NotCompiledError

    with suppress(_NotCompiledError), listening(CompilationProgress(1, leave)):
        yield
