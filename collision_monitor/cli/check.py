"""`collision-monitor check`: test recorded sessions against expectations."""

from __future__ import annotations

import argparse
import json
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any

from collision_monitor.cli.options.engines import add_engine, engine_of
from collision_monitor.cli.options.usage import check_profiles, given_rules, usage
from collision_monitor.cli.output.exit_codes import ExitCode
from collision_monitor.cli.output.output_file import add_force, check_outputs, writing
from collision_monitor.cli.output.progress import progress_bar

if TYPE_CHECKING:
    from collision_monitor.session.history.check import Checked

EXAMPLE = """\
expect:
  - contact: [cart, person_3]     # the first contact of the two begins in this window
    between: [4.0, 4.2]           # s from the first step of the session
  - no_contact: [cart, "wall_*"]  # the two never touch; an unresolved contact fails
  - no_prediction: any            # no collision is predicted to begin sooner than this
    under: 0.5                    # s
  - warned: any                   # every contact is predicted without a break for this long before it
    before: 0.8                   # s
  - alert: [cart, person_3]       # the first alert of the two is raised in this window
    level: warning                # to this level or above: caution, warning, critical
    between: [2.0, 4.0]           # s from the first step of the session
  - no_alert: any                 # no alert of the rule reaches the level
    rule: people
    level: critical
  - step_time_p99: 0.005          # s; 99 % of the steps take at most this long
  - replay: identical             # a replay gives the same answers, byte by byte
  - complete: true                # no message is missing, refused or lost
"""

EPILOG = f"""\
examples:
  collision-monitor check run.mcap --expect expectations.yaml
  collision-monitor check runs --expect expectations.yaml --replay fast   answers of the profile fast
  collision-monitor check "runs/*.mcap" --expect expectations.yaml --junit results.xml --force

expectations.yaml, with every kind of expectation:

{EXAMPLE}
Objects are given by name, with wildcards, or by id. `any` selects every pair. If messages are
missing, an expectation that something did not happen fails with "not known".

exit codes:
  0  all expectations hold
  1  a session cannot be read, or the file of --junit cannot be written
  2  wrong usage, or the expectations file is not valid
  3  an expectation does not hold
"""


def add_parser(subparsers: Any) -> None:
    """Register the command and its options."""
    parser = subparsers.add_parser(
        "check",
        help="test recorded sessions against expectations",
        description="Test recorded sessions against expectations: which objects touch and when, and how early that is\n"
        "predicted. Prints each expectation as ok or FAILED, with the observed value.",
        epilog=EPILOG,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument(
        "sessions", nargs="+", metavar="SESSION", help="session files, folders of sessions, or wildcards"
    )
    parser.add_argument("--expect", type=Path, required=True, metavar="FILE", help="file of expectations (YAML)")
    parser.add_argument(
        "--replay", nargs="?", const="", metavar="PROFILE",
        help="check the answers of a replay, with the recorded profile or with PROFILE",
    )  # fmt: skip
    parser.add_argument(
        "--rules",
        metavar="FILE",
        help="rules of alerts (YAML) that replace those of the sessions, for which it replays them",
    )
    add_engine(parser)
    parser.add_argument("--junit", type=Path, metavar="FILE", help="write the results as JUnit XML")
    add_force(parser, "the file of --junit")
    parser.add_argument("--json", action="store_true", help="print the results as one JSON object")
    parser.set_defaults(command=check_command)


def check_command(args: argparse.Namespace) -> int:
    """Run the command and return the exit code. Raises UsageError, InputError, SessionError, UnsupportedError."""
    from collision_monitor.session.history.check import check_sessions, junit_xml
    from collision_monitor.session.history.expectations import read_expectations
    from collision_monitor.session.many_sessions import find_sessions

    engine = engine_of(args)
    check_profiles([args.replay or ""])
    with usage():
        expectations = read_expectations(args.expect)
    rules = None if args.rules is None else given_rules(args.rules)
    paths = find_sessions(args.sessions)
    check_outputs({"--junit": args.junit}, force=args.force, inputs=[*paths, args.expect, args.rules, args.replay])
    results = []
    with progress_bar("check", len(paths)) as done:
        for each in check_sessions(paths, expectations, with_profile=args.replay, rules=rules, engine=engine):
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
