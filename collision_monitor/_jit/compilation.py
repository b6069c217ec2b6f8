"""Notices when a kernel is compiled rather than loaded from the cache, or prevents it."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress

from numba.core import event


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
    with event.install_listener("numba:compile", _First(call)):
        yield


class _NotCompiledError(Exception):
    """A kernel is not in the cache."""


@contextmanager
def compiling_nothing() -> Iterator[None]:
    """Load the kernels that the block calls, and leave it at the first one that would have to be compiled."""

    def leave() -> None:
        raise _NotCompiledError

    with suppress(_NotCompiledError), on_first_compilation(leave):
        yield
