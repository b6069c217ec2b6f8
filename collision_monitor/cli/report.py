"""`collision-monitor report`: write one HTML page about a session."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

from collision_monitor.cli.options.usage import check_profiles, given_rules
from collision_monitor.cli.output.exit_codes import ExitCode
from collision_monitor.cli.output.output_file import add_force
from collision_monitor.cli.output.progress import session_bar

DESCRIPTION = """\
Write one HTML page about a session: the verdict, a timeline, predicted against actual times of
contact, alerts, distances, tracks from above, and step times. The page is a single file that loads nothing
else. The command prints the path of each file that it writes.
"""
EPILOG = """\
examples:
  collision-monitor report run.mcap                          write run.html
  collision-monitor report run.mcap -o page.html --png figs  write the figures as PNG files too
  collision-monitor report run.mcap --replay fast            report the answers of the profile fast

exit codes:
  0  the page was written
  1  the session cannot be read, or a file cannot be written
  2  wrong usage
"""


def add_parser(subparsers: Any) -> None:
    """Register the command and its options."""
    parser = subparsers.add_parser(
        "report",
        help="write an HTML page about a session: collisions, warnings, tracks",
        description=DESCRIPTION,
        epilog=EPILOG,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("session", type=Path, metavar="SESSION", help=".mcap file, or a folder that holds one session")
    parser.add_argument(
        "-o", "--output", type=Path, metavar="FILE", help="HTML file (default: SESSION.html in the current folder)"
    )
    parser.add_argument(
        "--png", type=Path, metavar="FOLDER", help="also write the figures as PNG files into this folder"
    )
    parser.add_argument(
        "--replay", nargs="?", const="", metavar="PROFILE",
        help="report the answers of a replay, with the recorded profile or with PROFILE",
    )  # fmt: skip
    parser.add_argument("--rules", metavar="FILE", help="report the alerts of a replay, by these rules (YAML)")
    add_force(parser)
    parser.set_defaults(command=report_command)


def report_command(args: argparse.Namespace) -> int:
    """Run the command and return the exit code. Raises UsageError, SessionError."""
    from collision_monitor.report import check_report, write_report
    from collision_monitor.session import Session
    from collision_monitor.session.history.read_history import read_history

    check_profiles([args.replay or ""])
    rules = None if args.rules is None else given_rules(args.rules)
    session = Session(args.session)
    output = args.output or Path(f"{args.session.resolve().stem}.html")
    read = [Path(each) for each in (args.session, args.replay, args.rules) if each]
    check_report(output, args.png, overwrite=args.force, inputs=read)
    with session_bar("report", session) as show:
        history = read_history(session, args.replay, show, rules)
    for file in write_report(history, output, pictures=args.png, overwrite=args.force):
        print(file)
    return ExitCode.DONE
