"""`collision-monitor check`: recorded sessions as regression tests."""

from __future__ import annotations

import argparse
import json
import sys
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any

from collision_monitor.cli.engines import add_engine, engine_of
from collision_monitor.cli.exit_codes import ExitCode
from collision_monitor.cli.output_file import writing
from collision_monitor.cli.progress import progress_bar
from collision_monitor.errors import InputError

if TYPE_CHECKING:
    from collision_monitor.session.history.check import Checked

EXAMPLE = """\
expect:
  - contact: [cart, person_3]     # they touch, first within this window (s from the session's first step)
    between: [4.0, 4.2]
  - no_contact: [cart, "wall_*"]  # never, as far as is known; names with wildcards, or ids; any: no pair at all
  - no_prediction: any            # no collision is predicted to be due sooner than this
    under: 0.5                    # s
  - warned: any                   # each contact was predicted without a break from this long before it on
    before: 0.8                   # s
  - step_time_p99: 0.005          # s, at most
  - replay: identical             # today's program gives the same answers, byte by byte
  - complete: true                # nothing is missing, nothing was refused or lost
"""

EPILOG = f"""\
expectations.yaml, with everything that can be expected:

{EXAMPLE}
exit codes: 0 all hold, 1 a session could not be read, 2 expectations.yaml is not as it should be,
3 an expectation does not hold
"""


def add_parser(subparsers: Any) -> None:
    """Register the command."""
    parser = subparsers.add_parser(
        "check",
        help="test recorded sessions against what is expected of them",
        description="Test recorded sessions against what is expected: who touches whom and when, how early predicted.",
        epilog=EPILOG,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("sessions", nargs="+", metavar="SESSION", help="session files, folders of them, or wildcards")
    parser.add_argument("--expect", type=Path, required=True, metavar="FILE", help="the expectations, YAML")
    parser.add_argument(
        "--replay", nargs="?", const="", metavar="PROFILE",
        help="check what this program answers to the inputs, with the recorded profile or this one",
    )  # fmt: skip
    add_engine(parser)
    parser.add_argument("--junit", type=Path, metavar="FILE", help="write the results as JUnit XML")
    parser.add_argument("--json", action="store_true", help="print the results as one JSON object")
    parser.set_defaults(command=check_command)


def check_command(args: argparse.Namespace) -> int:
    """Return the exit code. Raises InputError, UnsupportedError."""
    from collision_monitor.session.history.check import check_sessions, junit_xml
    from collision_monitor.session.history.expectations import read_expectations
    from collision_monitor.session.many import find_sessions
    from collision_monitor.settings.profile import Profile

    try:
        expectations = read_expectations(args.expect)
        if args.replay:
            Profile.named(args.replay)
    except InputError as error:
        print(f"collision-monitor: error: {error}", file=sys.stderr)
        return ExitCode.USAGE
    paths = find_sessions(args.sessions)
    if args.junit is not None:
        with writing(args.junit):  # an error comes before the work is done, not after it
            args.junit.open("a").close()
    results = []
    with progress_bar("check", len(paths)) as done:
        for each in check_sessions(paths, expectations, with_profile=args.replay, engine=engine_of(args)):
            results.append(each)
            done(1)
            if not args.json:
                print(_as_text(each), flush=True)
    if args.junit is not None:
        with writing(args.junit):
            args.junit.write_text(junit_xml(results), encoding="utf-8")
    if args.json:
        print(json.dumps({"sessions": [asdict(each) | {"holds": each.holds} for each in results]}, indent=2))
    else:
        failed, broken = sum(not r.holds and not r.error for r in results), sum(bool(r.error) for r in results)
        print(f"{len(results)} sessions: {len(results) - failed - broken} hold, {failed} fail, {broken} cannot be read")
    if any(each.error for each in results):
        return ExitCode.ERROR
    return ExitCode.DONE if all(each.holds for each in results) else ExitCode.NOT_AS_EXPECTED


def _as_text(each: Checked) -> str:
    lines = [f"{each.session}: {'ok' if each.holds else 'cannot be read' if each.error else 'FAILED'}"]
    if each.error:
        lines.append(f"  {each.error}")
    lines += [f"  {'ok    ' if o.holds else 'FAILED'} {o.expectation}: {o.found}" for o in each.outcomes]
    return "\n".join(lines)
