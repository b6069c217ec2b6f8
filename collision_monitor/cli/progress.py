"""A progress bar on stderr, shown only if stderr is a terminal."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collision_monitor.session import Session


@contextmanager
def progress_bar(name: str, total: int) -> Iterator[Callable[[int], None]]:
    """Yield a function that advances the bar by the given part of `total`."""
    if not sys.stderr.isatty():
        yield lambda done: None
        return
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
