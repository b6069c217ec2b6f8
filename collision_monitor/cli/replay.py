"""`collision-monitor replay`: the same inputs again, without ROS, and are the answers the same bytes?"""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from collision_monitor.session import Session
    from collision_monitor.session.replay import Report

EPILOG = """\
exit codes: 0 the answers are identical, 1 the session cannot be read, 3 they differ (the first difference is named),
4 they cannot be compared: they differ and were recorded by another version or machine, or messages are missing
"""


def add_parser(subparsers: Any) -> None:
    """Register the command."""
    parser = subparsers.add_parser(
        "replay",
        help="replay a session and compare the answers byte by byte",
        description="Feed the recorded inputs to the same pipeline, without ROS, and compare its answers byte by byte.",
        epilog=EPILOG,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("session", type=Path, metavar="SESSION", help="a .mcap file, or a folder that holds one")
    parser.add_argument("--threads", type=int, metavar="N", help="threads of the kernels (default: as recorded)")
    parser.add_argument("--json", action="store_true", help="print the result as one JSON object")
    parser.set_defaults(command=replay_command)


def replay_command(args: argparse.Namespace) -> int:
    """Return the exit code. Raises SessionError."""
    from collision_monitor.session import Session
    from collision_monitor.session.replay import replay

    session = Session(args.session)
    with _progress_bar(session) as progress:
        report = replay(session, threads=args.threads, progress=progress)
    print(json.dumps(_as_json(report, args.session), indent=2) if args.json else _as_text(report))
    return int(report.verdict)


@contextmanager
def _progress_bar(session: Session) -> Iterator[Callable[[Report], None] | None]:
    """A bar on stderr, where that is a terminal."""
    if not sys.stderr.isatty():
        yield None
        return
    from rich.console import Console
    from rich.progress import BarColumn, Progress, TextColumn

    columns = (TextColumn("replay"), BarColumn(), TextColumn("{task.percentage:3.0f} %  {task.fields[text]}"))
    with Progress(*columns, console=Console(stderr=True), transient=True) as bar:
        task = bar.add_task("", total=session.size, text="")
        shown = 0.0

        def show(report: Report) -> None:
            nonlocal shown
            if report.replay_duration - shown >= 0.1:
                shown = report.replay_duration
                text = f"{report.recorded_duration:.1f} s, step {report.steps}, {report.speed:.0f} × real time"
                bar.update(task, completed=session.position, text=text)

        yield show


def _as_text(report: Report) -> str:
    from collision_monitor.session.replay import Verdict

    lines = [
        f"steps      {report.steps}",
        f"messages   {report.messages}, of which {report.compared} answers were compared",
        f"recorded   {report.recorded_duration:.3f} s",
        f"replayed   {report.replay_duration:.3f} s, {report.speed:.1f} × real time",
        f"digest     {report.digest:016x}",
        *(f"note       {note}" for note in report.notes),
    ]
    if report.first_difference is not None:
        lines.append(f"different  {report.first_difference}")
    verdicts = {
        Verdict.IDENTICAL: "identical",
        Verdict.DIVERGED: f"diverged in {report.differing} of {report.steps} steps",
        Verdict.NOT_COMPARABLE: "not comparable",
    }
    return "\n".join([*lines, f"verdict    {verdicts[report.verdict]}"])


def _as_json(report: Report, session: Path) -> dict[str, Any]:
    from dataclasses import asdict

    return {
        "session": str(session),
        "verdict": report.verdict.name.lower(),
        **asdict(report),
        "digest": f"{report.digest:016x}",
        "speed": report.speed,
    }
