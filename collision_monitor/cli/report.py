"""`collision-monitor report`: a session as one HTML file that people look at."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

from collision_monitor.cli.exit_codes import ExitCode
from collision_monitor.cli.progress import session_bar
from collision_monitor.errors import SessionError


def add_parser(subparsers: Any) -> None:
    """Register the command."""
    parser = subparsers.add_parser(
        "report",
        help="a session as one HTML page: collisions, how early they were predicted, tracks",
        description="Write one HTML file that needs nothing else: verdict, timeline, predicted against actual, tracks.",
    )
    parser.add_argument("session", type=Path, metavar="SESSION", help="a .mcap file, or a folder that holds one")
    parser.add_argument("-o", "--output", type=Path, metavar="FILE", help="default: SESSION.html, where you are")
    parser.add_argument("--png", type=Path, metavar="FOLDER", help="write the pictures there too")
    parser.add_argument(
        "--replay", nargs="?", const="", metavar="PROFILE",
        help="report what this program answers to the inputs, with the recorded profile or this one",
    )  # fmt: skip
    parser.add_argument("--force", action="store_true", help="overwrite what is there")
    parser.set_defaults(command=report_command)


def report_command(args: argparse.Namespace) -> int:
    """Return the exit code. Raises SessionError, ProfileError."""
    from collision_monitor.report import check_outputs, write_report
    from collision_monitor.session import Session
    from collision_monitor.session.history.read_history import read_history

    session = Session(args.session)
    output = args.output or Path(f"{args.session.resolve().stem}.html")
    if output.exists() and output.samefile(args.session):
        raise SessionError(f"{output}: expected another file than the session itself")
    check_outputs([output], args.force)  # before what takes long
    with session_bar("report", session) as show:
        history = read_history(session, args.replay, show)
    for file in write_report(history, output, pictures=args.png, overwrite=args.force):
        print(file)
    return ExitCode.DONE
