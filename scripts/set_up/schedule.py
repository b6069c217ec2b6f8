"""Run stages side by side, each as soon as those it comes after are done."""

from __future__ import annotations

import subprocess
import sys
import time
from collections.abc import Callable
from concurrent.futures import FIRST_COMPLETED, Future, ThreadPoolExecutor, wait

from stages import Stage

WORKERS = 2
"""Stages at a time. All but pip are compilers, and more than two wait for memory."""

LOOK = 1.0
"""Seconds between two looks at the running stages, whose time is then shown."""


class StageError(Exception):
    """A stage failed."""

    def __init__(self, stage: Stage, cause: Exception) -> None:
        super().__init__(f"{stage.name}: {cause}")
        self.stage = stage


def run(pending: list[Stage], work: Callable[[Stage], None]) -> None:
    """Call `work` for each pending stage, in this order as far as they do not wait for each other.

    Print a line when a stage is done, and on a terminal meanwhile what runs. Raises StageError for the first failure,
    after the stage beside it has ended; no other stage begins.
    """
    waiting = list(pending)
    running: dict[Future[None], tuple[Stage, float]] = {}
    with ThreadPoolExecutor(WORKERS) as pool:
        while waiting or running:
            for stage in _ready(waiting, [each for each, _ in running.values()]):
                waiting.remove(stage)
                running[pool.submit(work, stage)] = stage, time.monotonic()
            _show(running)
            for done in wait(running, LOOK, FIRST_COMPLETED).done:
                stage, began = running.pop(done)
                try:
                    done.result()
                except (OSError, subprocess.CalledProcessError) as error:
                    _print(f"{_line(stage)} failed\n")
                    raise StageError(stage, error) from error
                _print(f"{_line(stage)}{time.monotonic() - began:6.1f} s\n")


def _ready(waiting: list[Stage], running: list[Stage]) -> list[Stage]:
    """The stages that can begin now."""
    unfinished = {each.name for each in (*waiting, *running)}
    return [each for each in waiting if unfinished.isdisjoint(each.after)][: WORKERS - len(running)]


def _line(stage: Stage) -> str:
    return f"  {stage.name:<12} {stage.text:<34}"


def _show(running: dict[Future[None], tuple[Stage, float]]) -> None:
    if sys.stdout.isatty():
        now = time.monotonic()
        _print("  … " + ", ".join(f"{stage.text} ({now - began:.0f} s)" for stage, began in running.values()))


def _print(text: str) -> None:
    """Print over the line of the running stages."""
    print(("\r\033[K" if sys.stdout.isatty() else "") + text, end="", flush=True)
