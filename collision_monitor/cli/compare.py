"""`collision-monitor compare`: list the differences of two sessions, or of one session under two profiles."""

from __future__ import annotations

import argparse
import json
import math
from collections import Counter
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any

from collision_monitor.cli.options.quantities import not_negative, whole
from collision_monitor.cli.options.usage import UsageError, check_profiles
from collision_monitor.cli.output.exit_codes import ExitCode
from collision_monitor.cli.output.missing import missing_lines
from collision_monitor.cli.output.progress import session_bar

if TYPE_CHECKING:
    from collision_monitor.session.history.changes import Changes, Event, EventChange
    from collision_monitor.session.history.history import History

EPILOG = """\
examples:
  collision-monitor compare yesterday.mcap today.mcap
  collision-monitor compare run.mcap --profile fast --profile exact   two replays of one session
  collision-monitor compare run.mcap --profile fast                   the recorded answers and a replay
  collision-monitor compare before.mcap after.mcap --replay           replays of both sessions

An alarm is a pair that is reported at a step, in contact or predicted. It is false if the pair does
not touch within the horizon (`tradeoff` and `tune` count the same). A collision is missed if its pair
is not alarmed in the step before. A warning is an unbroken run of predictions, at least one of them
certain, that no collision followed. Objects are matched by name. Times
count from the first step of A, also for B if the stamps of the sessions overlap. Otherwise the
times of B count from its own first step. Step times are shown but never count as a difference.

exit codes:
  0  the same collisions and warnings
  1  a session cannot be read
  2  wrong usage
  3  the sessions differ
  4  no difference was found, but a session is incomplete
"""


def add_parser(subparsers: Any) -> None:
    """Register the command and its options."""
    parser = subparsers.add_parser(
        "compare",
        help="list the differences of two sessions, or of two profiles on one session",
        description="Compare two sessions, or one session under two profiles, as A and B. Prints totals and step\n"
        "times of both sides, then every collision and warning that differs.",
        epilog=EPILOG,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument(
        "sessions",
        nargs="+",
        type=Path,
        metavar="SESSION",
        help="two sessions (A and B), or one session with --profile",
    )
    parser.add_argument(
        "--profile", action="append", default=[], metavar="NAME", help="replay with this profile; may be repeated"
    )
    parser.add_argument("--replay", action="store_true", help="compare answers of a replay, not the recorded ones")
    parser.add_argument(
        "--tolerance", type=not_negative, default=0.0, metavar="S",
        help="largest difference of equal times (s, default: 0)",
    )  # fmt: skip
    parser.add_argument(
        "--limit", type=whole(1), default=20, metavar="N", help="largest number of differences to list (default: 20)"
    )
    parser.add_argument("--json", action="store_true", help="print everything as one JSON object")
    parser.set_defaults(command=compare_command)


def compare_command(args: argparse.Namespace) -> int:
    """Run the command and return the exit code. Raises UsageError, SessionError."""
    from collision_monitor.session.history.changes import changes

    check_profiles(args.profile)
    a, b = (_history(path, profile) for path, profile in _sides(args))
    found = changes(a, b, args.tolerance)
    print(json.dumps(_as_json(found), indent=2) if args.json else _as_text(found, args.limit))
    if found.changes:
        return ExitCode.NOT_AS_EXPECTED
    return ExitCode.DONE if found.known else ExitCode.NOT_KNOWN


def _sides(args: argparse.Namespace) -> list[tuple[Path, str | None]]:
    """Return session and profile of each side. None: recorded answers. Empty: replay with the recorded profile."""
    paths, profiles = args.sessions, args.profile
    match len(paths), len(profiles):
        case 2, 0:
            return [(path, "" if args.replay else None) for path in paths]
        case 1, 1:
            return [(paths[0], "" if args.replay else None), (paths[0], profiles[0])]
        case 1, 2:
            return [(paths[0], profile) for profile in profiles]
    raise UsageError(
        f"compare: expected two sessions, or one session and one or two --profile; got {len(paths)} and {len(profiles)}"
    )


def _history(path: Path, with_profile: str | None) -> History:
    from collision_monitor.session import Session
    from collision_monitor.session.history.read_history import read_history

    session = Session(path)
    with session_bar(path.name, session) as show:
        return read_history(session, with_profile, show)


# -- text


def _as_text(found: Changes, limit: int) -> str:
    lines = [_row("", "A", "B")]
    sides = (found.a, found.b)
    lines.append(_row("session", *(side.session for side in sides)))
    lines.append(_row("answers", *(f"{side.profile}, {'replayed' if side.replayed else 'recorded'}" for side in sides)))
    lines.append(_row("recorded by", *(f"version {side.version}" for side in sides)))
    lines.append(_row("duration", *(f"{side.duration:.3f} s, {side.steps} steps" for side in sides)))
    for title, name in (
        ("objects", "objects"),
        ("collisions", "collisions"),
        ("contacts × steps", "contacts"),
        ("predictions × steps", "predictions"),
    ):
        lines.append(_row(title, *(str(getattr(side, name)) for side in sides)))
    for title, name in (
        ("alarms × steps", "alarms"),
        ("  false", "false_alarms"),
        ("  too late", "late"),
        ("  too early", "early"),
        ("collisions missed", "missed"),
    ):
        lines.append(_row(title, *(str(getattr(side.alarms, name)) for side in sides)))
    lines.append(_row("step time, median", *(_milliseconds(side.step_median) for side in sides)))
    lines.append(_row("step time, 99 %", *(_milliseconds(side.step_p99) for side in sides)))
    for letter, side in zip("AB", sides, strict=True):
        lines += missing_lines(side.problems, f" in {letter}")
    if found.changes:
        lines += ["", *(_change(each) for each in found.changes[:limit])]
        if len(found.changes) > limit:
            lines.append(f"and {len(found.changes) - limit} more (--limit, --json)")
    return "\n".join([*lines, "", _verdict(found)])


def _row(title: str, a: str, b: str) -> str:
    return f"{title:<20} {a:<28} {b}".rstrip()


def _milliseconds(seconds: float) -> str:
    return "not known" if math.isnan(seconds) else f"{seconds * 1e3:.3f} ms"


def _change(change: EventChange) -> str:
    event = change.event
    if change.a is None or change.b is None:
        where = "only in A" if change.b is None else "only in B"
        return f"{event.begin:9.3f} s  {event.what:<9}  {where:<9}  {' – '.join(event.pair)}{_details(event)}"
    a, b = change.a, change.b
    differences = ", ".join(f"{name} {_value(a, name)} → {_value(b, name)}" for name in change.fields)
    return f"{event.begin:9.3f} s  {event.what:<9}  {'changed':<9}  {' – '.join(event.pair)}: {differences}"


def _details(event: Event) -> str:
    words = ["goes on" if event.end is None else f"until {event.end:.3f} s"]
    if event.what == "collision":
        words.append(f"warned {_value(event, 'warned')}")
        words += [] if event.certain else ["UNRESOLVED"]
    return f": {', '.join(words)}"


def _value(event: Event, name: str) -> str:
    value = getattr(event, name)
    if value is None:
        return "at the start" if name == "warned" else "goes on"
    if isinstance(value, bool):
        return "certain" if value else "UNRESOLVED"
    return f"{value:.3f} s" if name != "warned" or value else "not at all"


def _verdict(found: Changes) -> str:
    if not found.changes:
        return "the same" if found.known else "no difference was found, but not all is known"
    counts = Counter(
        (each.event.what, "only in A" if each.b is None else "only in B" if each.a is None else "changed")
        for each in found.changes
    )
    return "different: " + ", ".join(
        f"{count} {what}{'' if count == 1 else 's'} {kind}" for (what, kind), count in sorted(counts.items())
    )


def _as_json(found: Changes) -> dict[str, Any]:
    def plain(side: Any) -> dict[str, Any]:
        return {key: None if isinstance(v, float) and math.isnan(v) else v for key, v in asdict(side).items()}

    return {
        "same": not found.changes and found.known,
        "known": found.known,
        "by_stamps": found.by_stamps,
        "a": plain(found.a),
        "b": plain(found.b),
        "changes": [asdict(each) for each in found.changes],
    }
