"""Reads hostile session files in a process of its own, within limits of time and memory, and reports how each ended.

Each line on stdin names a file; each line on stdout is a JSON object: `problem` (empty if the file was answered as it
should), and for each way of reading it the outcome, the time (s) and the growth of memory (MiB).
"""

from __future__ import annotations

import faulthandler
import json
import os
import shutil
import sys
import time
import traceback
from collections.abc import Callable
from pathlib import Path
from typing import Any

from collision_monitor.errors import CollisionMonitorError
from collision_monitor.session import Session
from collision_monitor.session.mcap.salvage import salvage
from collision_monitor.session.replaying.replay import replay

SECONDS = 5.0
"""Time of a processor for a file of up to 1 MB; more in proportion to its size."""

GROWTH = 256
"""Memory beyond that of the process before it reads its first hostile file (MiB)."""

HANG = 120.0
"""Time of the clock after which the process ends itself with a traceback (s)."""


def resident() -> float:
    """Peak of the resident memory since the last `reset` (MiB)."""
    status = Path("/proc/self/status").read_text()
    return int(status.partition("VmHWM:")[2].split()[0]) / 1024


def reset() -> None:
    Path("/proc/self/clear_refs").write_text("5")


def read(path: Path) -> str:
    session = Session(path)
    session.timeline()
    count = sum(1 for _ in session.entries())
    return f"{count} entries, {len(session.damage)} damaged"


def replayed(path: Path) -> str:
    return replay(Session(path)).verdict.name


def salvaged(path: Path) -> str:
    return f"{salvage(path, _out(path), unverified=True, overwrite=True).messages} messages"


def _out(path: Path) -> Path:
    return path.with_suffix(".salvaged.mcap")


def replayed_after_salvage(path: Path) -> str:
    if not _out(path).exists():
        return "nothing salvaged"
    return replay(Session(_out(path))).verdict.name


WAYS: tuple[Callable[[Path], str], ...] = (read, replayed, salvaged, replayed_after_salvage)


def attempt(path: Path, base: float) -> dict[str, Any]:
    """Outcome of one file. base: memory before the first one (MiB)."""
    outcomes: dict[str, Any] = {}
    problems = []
    seconds = SECONDS * max(1.0, path.stat().st_size / 1e6)
    for way in WAYS:
        reset()
        begin = time.process_time()
        try:
            text = way(path)
        except CollisionMonitorError as error:
            text = f"{type(error).__name__}: {error}"
            if not str(error).strip():
                problems.append(f"{way.__name__}: an error without a text")
        except BaseException as error:
            text = f"{type(error).__name__}: {error}"
            problems.append(f"{way.__name__}: {traceback.format_exc()}")
        took, grown = time.process_time() - begin, resident() - base
        if took > seconds:
            problems.append(f"{way.__name__} took {took:.1f} s")
        if grown > GROWTH:
            problems.append(f"{way.__name__} took {grown:.0f} MiB")
        outcomes[way.__name__] = [text[:200], round(took, 3), round(grown)]
    _out(path).unlink(missing_ok=True)
    return {"problem": "\n".join(problems), "outcomes": outcomes}


def main() -> None:
    # a copy of its own, because several processes salvage beside the file
    warm = Path(shutil.copy(sys.argv[1], f"{sys.argv[1]}.{os.getpid()}.mcap"))
    answers, sys.stdout = sys.stdout, sys.stderr
    for way in WAYS:
        way(warm)
    _out(warm).unlink(missing_ok=True)
    warm.unlink()
    reset()
    base = resident()
    for line in sys.stdin:
        faulthandler.dump_traceback_later(HANG, exit=True)
        answer = attempt(Path(line.rstrip("\n")), base)
        faulthandler.cancel_dump_traceback_later()
        answers.write(json.dumps(answer) + "\n")
        answers.flush()


if __name__ == "__main__":
    os.environ.setdefault("NUMBA_NUM_THREADS", "1")
    main()
