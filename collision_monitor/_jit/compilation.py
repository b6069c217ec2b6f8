"""Notices when a kernel is compiled rather than loaded from the cache, or prevents it."""

from __future__ import annotations

import logging
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from typing import Any, Final

from numba.core import event

_TEXT: Final = (
    "compiling the kernels of the first calls, once for this machine and version: this takes some seconds; "
    "`python -m collision_monitor.warm_up` compiles all in advance"
)


class Announcement(event.Listener):
    """Says once, in the log and in a terminal, that a call takes long because its kernel is compiled.

    Programs that say so themselves do it with `on_first_compilation`.
    """

    is_made = False

    def on_start(self, event: Any) -> None:
        """Announce the first compilation of this package."""
        if not Announcement.is_made and event.data["dispatcher"].py_func.__module__.startswith("collision_monitor."):
            Announcement.is_made = True
            logging.getLogger("collision_monitor").info(_TEXT)
            if sys.stderr is not None and sys.stderr.isatty():
                print(f"collision_monitor: {_TEXT}", file=sys.stderr, flush=True)

    def on_end(self, event: Any) -> None:
        """Nothing to do."""


class _First(event.Listener):
    def __init__(self, call: Callable[[], object]) -> None:
        self._call: Callable[[], object] | None = call

    def on_start(self, event: object) -> None:
        call, self._call = self._call, None
        if call is not None:
            call()

    def on_end(self, event: object) -> None:
        pass


@contextmanager
def on_first_compilation(call: Callable[[], object]) -> Iterator[None]:
    """Call the function when the first kernel is compiled within the block; not if all are loaded."""
    before, Announcement.is_made = Announcement.is_made, True
    try:
        with event.install_listener("numba:compile", _First(call)):
            yield
    finally:
        Announcement.is_made = before


class _NotCompiledError(Exception):
    """A kernel is not in the cache."""


@contextmanager
def compiling_nothing() -> Iterator[None]:
    """Load the kernels that the block calls, and leave it at the first one that would have to be compiled."""

    def leave() -> None:
        raise _NotCompiledError

    with suppress(_NotCompiledError), on_first_compilation(leave):
        yield
