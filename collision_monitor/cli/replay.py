"""`collision-monitor replay`: replay the recorded inputs without ROS and compare the answers byte by byte."""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from collision_monitor.cli.options.engines import RAY, add_engine, engine_of
from collision_monitor.cli.options.quantities import not_negative, positive_number
from collision_monitor.cli.options.usage import UsageError, usage
from collision_monitor.cli.output.exit_codes import ExitCode
from collision_monitor.cli.output.output_file import add_force, check_outputs
from collision_monitor.cli.output.progress import progress_bar

if TYPE_CHECKING:
    from collision_monitor.session import Session
    from collision_monitor.session.many_sessions import Engine
    from collision_monitor.session.replaying.replay_report import ReplayReport

EPILOG = """\
examples:
  collision-monitor replay run.mcap
  collision-monitor replay run.mcap --from 60 --cut bug.mcap    a short session with the first difference
  collision-monitor replay old.mcap --tolerance 1e-6            a session of another version
  collision-monitor replay sessions --jobs 4                    every session in a folder

exit codes:
  0  the answers are identical
  1  a session cannot be read, or OUT cannot be written
  2  wrong usage
  3  the answers differ
  4  the answers cannot be compared: they differ and were recorded by another version or machine, or
     messages are missing
With several sessions, or on Ray, each has a line, and the exit code is the smallest that is not 0.
"""


def add_parser(subparsers: Any) -> None:
    """Register the command and its options."""
    parser = subparsers.add_parser(
        "replay",
        help="replay a session and compare the answers byte by byte",
        description="Feed the recorded inputs to the monitor, without ROS, and compare its answers with the recorded\n"
        "ones, byte by byte. Prints the digest of the answers, the first difference with its inputs, and the\n"
        "verdict.",
        epilog=EPILOG,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument(
        "sessions", nargs="+", metavar="SESSION", help="session files, folders of sessions, or wildcards"
    )
    parser.add_argument("--threads", type=int, metavar="N", help="number of threads (default: as recorded)")
    parser.add_argument(
        "--from", dest="start", type=not_negative, metavar="T", default=0.0,
        help="start at the last snapshot before this time (s from the first message, default: 0)",
    )  # fmt: skip
    parser.add_argument(
        "--tolerance",
        type=positive_number,
        metavar="X",
        help="for sessions of other versions: largest difference of equal numbers (m, s)",
    )
    parser.add_argument(
        "--cut",
        type=Path,
        metavar="OUT",
        help="if answers differ, write a short session that shows the first difference",
    )
    add_force(parser, "OUT")
    add_engine(parser)
    parser.add_argument("--json", action="store_true", help="print the result as one JSON object")
    parser.set_defaults(command=replay_command)


def replay_command(args: argparse.Namespace) -> int:
    """Run the command and return the exit code. Raises UsageError, InputError, SessionError."""
    from collision_monitor.session import Session
    from collision_monitor.session.many_sessions import find_sessions
    from collision_monitor.session.replaying.replay import replay
    from collision_monitor.settings.profile import Profile

    if args.threads is not None:
        with usage():
            Profile(threads=args.threads)
    engine = engine_of(args)
    if args.cut is not None and engine.name == RAY:
        raise UsageError(f"--cut: expected a replay in this process, got --engine {RAY}; leave one of the two out")
    paths = find_sessions(args.sessions)
    if len(paths) > 1 or engine.name == RAY:
        if args.cut is not None:
            raise UsageError(f"--cut: expected one session, got {len(paths)}")
        return _replay_many(paths, args, engine)
    check_outputs({"--cut": args.cut}, force=args.force, inputs=paths)
    session = Session(paths[0])
    with _progress_bar(session) as progress:
        report = replay(session, **_options(args), progress=progress)
    if args.cut is not None and report.first_message is not None:
        from collision_monitor.session.replaying.cut import cut

        count = cut(Session(paths[0]), report.first_message, args.cut, tolerance=args.tolerance, overwrite=args.force)
        report.notes.append(f"{count} messages that show the first difference are in {args.cut}")
    print(json.dumps(_as_json(report, paths[0]), indent=2) if args.json else _as_text(report))
    return int(report.verdict)


@dataclass(frozen=True)
class _Replayed:
    """Replay report of a session, or the reason why the session could not be read."""

    report: ReplayReport | None
    error: str = ""


def _options(args: argparse.Namespace) -> dict[str, Any]:
    return {"threads": args.threads, "tolerance": args.tolerance, "start": args.start}


def _replay_one(path: Path, options: dict[str, Any]) -> _Replayed:
    from collision_monitor.session import Session
    from collision_monitor.session.replaying.replay import replay

    return _Replayed(replay(Session(path), **options))


def _unread(_path: Path, why: str) -> _Replayed:
    return _Replayed(None, why)


def _replay_many(paths: list[Path], args: argparse.Namespace, engine: Engine) -> int:
    from collision_monitor.session.many_sessions import for_each

    found: list[_Replayed] = []
    with progress_bar("replay", len(paths)) as done:
        run = partial(_replay_one, options=_options(args))
        for path, each in zip(paths, for_each(run, paths, _unread, engine), strict=True):
            found.append(each)
            done(1)
            if not args.json:
                print(_as_lines(path, each), flush=True)
    if args.json:
        sessions = [
            {"session": str(path), "error": each.error} if each.report is None else _as_json(each.report, path)
            for path, each in zip(paths, found, strict=True)
        ]
        print(json.dumps({"sessions": sessions}, indent=2))
    codes = {ExitCode.ERROR if each.report is None else int(each.report.verdict) for each in found}
    return next((code for code in sorted(codes) if code), 0)


def _as_lines(path: Path, each: _Replayed) -> str:
    """Return the result as text, without durations, so that it is the same for any number of jobs."""
    if each.report is None:
        return f"{path}: cannot be read\n  {each.error}"
    report = each.report
    lines = [f"{path}: {_verdict(report)}, {report.steps} steps, digest {report.digest:016x}"]
    lines += [f"  note       {note}" for note in report.notes]
    lines += [f"  different  {report.first_difference}"] if report.first_difference is not None else []
    return "\n".join(lines)


@contextmanager
def _progress_bar(session: Session) -> Iterator[Callable[[ReplayReport], None] | None]:
    """Show a progress bar on stderr if it is a terminal."""
    if not sys.stderr.isatty():
        yield None
        return
    from rich.console import Console
    from rich.progress import BarColumn, Progress, TextColumn

    columns = (TextColumn("replay"), BarColumn(), TextColumn("{task.percentage:3.0f} %  {task.fields[text]}"))
    with Progress(*columns, console=Console(stderr=True), transient=True) as bar:
        task = bar.add_task("", total=session.size, text="")
        shown = 0.0

        def show(report: ReplayReport) -> None:
            nonlocal shown
            if report.replay_duration - shown >= 0.1:
                shown = report.replay_duration
                position = report.begin + report.recorded_duration
                text = f"{position:.1f} s, step {report.steps}, {report.speed:.0f} × real time, "
                text += f"{report.differing} steps differ" if report.differing else "no difference"
                bar.update(task, completed=session.position, text=text)

        yield show


def _verdict(report: ReplayReport) -> str:
    from collision_monitor.session.replaying.replay_report import Verdict

    if report.verdict is Verdict.DIVERGED:
        return f"diverged in {report.differing} of {report.steps} steps"
    if report.within and report.verdict is Verdict.IDENTICAL:
        return f"equal within {report.tolerance:g} m and s; the bytes of {report.within} answers differ"
    return report.verdict.name.lower().replace("_", " ")


def _as_text(report: ReplayReport) -> str:
    lines = [
        *([f"from       {report.begin:.3f} s"] if report.begin else []),
        f"steps      {report.steps}",
        f"messages   {report.messages}; {report.compared} answers were compared",
        f"recorded   {report.recorded_duration:.3f} s",
        f"replayed   {report.replay_duration:.3f} s, {report.speed:.1f} × real time",
        f"digest     {report.digest:016x}",
        *(f"note       {note}" for note in report.notes),
    ]
    if report.first_difference is not None:
        lines.append(f"different  {report.first_difference}")
        lines += [f"input      {each}" for each in report.inputs]
    return "\n".join([*lines, f"verdict    {_verdict(report)}"])


def _as_json(report: ReplayReport, session: Path) -> dict[str, Any]:
    from dataclasses import asdict

    return {
        "session": str(session),
        "verdict": report.verdict.name.lower(),
        **asdict(report),
        "digest": f"{report.digest:016x}",
        "speed": report.speed,
    }
