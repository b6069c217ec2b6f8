"""A progress bar on stderr for long work, where that is a terminal."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collision_monitor.session import Session


@contextmanager
def progress_bar(name: str, total: int) -> Iterator[Callable[[int], None]]:
    """Gives a function that is told how much more of `total` was done."""
    if not sys.stderr.isatty():
        yield lambda done: None
        return
    from rich.console import Console
    from rich.progress import BarColumn, Progress, TextColumn, TimeRemainingColumn

    columns = (TextColumn(name), BarColumn(), TimeRemainingColumn())
    console = Console(stderr=True)
    # what is printed meanwhile goes above the bar only where it goes to the terminal at all, not into a file or pipe
    with Progress(*columns, console=console, transient=True, redirect_stdout=sys.stdout.isatty()) as bar:
        task = bar.add_task("", total=total)
        yield lambda done: bar.update(task, advance=done)


@contextmanager
def session_bar(name: str, session: Session) -> Iterator[Callable[[], None]]:
    """Gives a function that shows how far the session was read."""
    with progress_bar(name, session.size) as done:
        last = 0

        def show() -> None:
            nonlocal last
            if session.position != last:
                done(session.position - last)
                last = session.position

        yield show
