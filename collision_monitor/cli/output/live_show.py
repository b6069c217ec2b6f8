"""The answers of a running monitor, drawn again and again: tables in a terminal, a line each second otherwise."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import TYPE_CHECKING

from collision_monitor import codec
from collision_monitor.cli.output.live_table import LatestAnswers

if TYPE_CHECKING:
    from collision_monitor.ros.listening.viewer import Viewer

FRAME = 0.25
"""Time between two pictures (s)."""
LINE = 1.0
"""Time between two lines if the output is not a terminal (s)."""


def show_live(viewer: Viewer, title: str, goes_on: Callable[[], bool]) -> LatestAnswers:
    """Draw what the viewer hears, from its first answers on, as long as it goes on. Return the last picture."""
    from rich.console import Console
    from rich.live import Live

    console = Console()
    period = FRAME if console.is_terminal else LINE
    began = time.monotonic()
    frame, heard_at = 0, None
    picture = _picture(viewer, title, 0.0)
    with Live(console=console, auto_refresh=False, transient=True) as live:
        while goes_on():
            frame += 1
            viewer.listen(until=began + frame * period)
            if viewer.contacts is None:
                continue
            heard_at = heard_at or time.monotonic()
            picture = _picture(viewer, title, time.monotonic() - heard_at)
            if console.is_terminal:
                live.update(picture.table(), refresh=True)
            else:
                print(picture.line(), flush=True)
    if console.is_terminal:
        console.print(picture.table())
    return picture


def _picture(viewer: Viewer, title: str, elapsed: float) -> LatestAnswers:
    return LatestAnswers(
        title=title,
        elapsed=elapsed,
        contacts=None if viewer.contacts is None else codec.decode_contacts(viewer.contacts),
        predictions=None if viewer.predictions is None else codec.decode_predictions(viewer.predictions),
        status=codec.MonitorStatus() if viewer.status is None else codec.decode_status(viewer.status),
    )
