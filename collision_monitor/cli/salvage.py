"""`collision-monitor salvage`: what is whole in a damaged recording, as a new one."""

from __future__ import annotations

import argparse
import json
from dataclasses import asdict
from pathlib import Path
from typing import Any

from collision_monitor.cli.exit_codes import ExitCode

EPILOG = """\
A chunk of messages counts where its checksum is right. What is complete in a chunk whose checksum is wrong is left out,
or kept with --unverified; what is complete and has no checksum is kept, and said to be unverified.

exit codes: 0 everything is there, 1 nothing could be recovered, 3 something is missing (it is said what)
"""


def add_parser(subparsers: Any) -> None:
    """Register the command."""
    parser = subparsers.add_parser(
        "salvage",
        help="recover what is whole in a recording that was cut off or damaged",
        description="Copy every complete message of a cut, overwritten or bit-flipped MCAP file into a new one.",
        epilog=EPILOG,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("session", type=Path, metavar="SESSION", help="the damaged .mcap file")
    parser.add_argument("-o", "--output", type=Path, required=True, metavar="OUT", help="the new .mcap file")
    parser.add_argument("--unverified", action="store_true", help="keep messages from chunks with a wrong checksum too")
    parser.add_argument("--force", action="store_true", help="overwrite OUT")
    parser.add_argument("--json", action="store_true", help="print the result as one JSON object")
    parser.set_defaults(command=salvage_command)


def salvage_command(args: argparse.Namespace) -> int:
    """Return the exit code. Raises SessionError."""
    from collision_monitor.session.mcap.salvage import salvage

    result = salvage(args.session, args.output, unverified=args.unverified, overwrite=args.force)
    if args.json:
        print(json.dumps({"session": str(args.session), "output": str(args.output), **asdict(result)}, indent=2))
    else:
        for topic, count in sorted(result.topics.items()):
            print(f"recovered  {count:8d}  {topic}")
        for note in result.notes:
            print(f"note       {note}")
        for loss in result.losses:
            print(f"lost       {loss}")
        trusted = f", {result.unverified} of them unverified" if result.unverified else ""
        print(f"written    {result.messages} messages{trusted} to {args.output}")
    return ExitCode.NOT_AS_EXPECTED if result.losses else ExitCode.DONE
