"""A progress bar on stderr if that is a terminal; else, for work of minutes, a line every few seconds."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING, Final

if TYPE_CHECKING:
    from collision_monitor.session import Session


LINE_EVERY: Final = 5.0
"""Time between two lines of progress (s)."""


@contextmanager
def progress_bar(name: str, total: int) -> Iterator[Callable[[int], None]]:
    """Yield a function that advances the bar by the given part of `total`."""
    if not sys.stderr.isatty():
        yield lambda done: None
        return
    with _bar(name, total) as advance:
        yield advance


@contextmanager
def progress_anywhere(name: str, total: int) -> Iterator[Callable[[int], None]]:
    """As `progress_bar`; if stderr is no terminal, print a line every LINE_EVERY seconds instead."""
    if sys.stderr.isatty():
        with _bar(name, total) as advance:
            yield advance
        return
    last, done = time.monotonic(), 0

    def print_line(count: int) -> None:
        nonlocal last, done
        done += count
        if time.monotonic() - last >= LINE_EVERY:
            last = time.monotonic()
            print(f"{name}: {100.0 * min(done / max(total, 1), 0.99):.0f} %", file=sys.stderr, flush=True)

    yield print_line


@contextmanager
def _bar(name: str, total: int) -> Iterator[Callable[[int], None]]:
    from rich.console import Console
    from rich.progress import BarColumn, Progress, TextColumn, TimeRemainingColumn

    columns = (TextColumn(name), BarColumn(), TimeRemainingColumn())
    console = Console(stderr=True)
    # redirect printed lines above the bar only if stdout is a terminal, not a file or pipe
    with Progress(*columns, console=console, transient=True, redirect_stdout=sys.stdout.isatty()) as bar:
        task = bar.add_task("", total=total)
        yield lambda done: bar.update(task, advance=done)


@contextmanager
def session_bar(name: str, session: Session) -> Iterator[Callable[[], None]]:
    """Yield a function that moves the bar to the read position of the session."""
    with progress_bar(name, session.size) as done:
        last = 0

        def show() -> None:
            nonlocal last
            if session.position != last:
                done(session.position - last)
                last = session.position

        yield show
