"""`collision-monitor salvage`: copy the complete messages of a damaged recording into a new one."""

from __future__ import annotations

import argparse
import json
from dataclasses import asdict
from pathlib import Path
from typing import Any

from collision_monitor.cli.output.exit_codes import ExitCode
from collision_monitor.cli.output.output_file import add_force

EPILOG = """\
Messages in a chunk with a correct checksum are copied. Complete messages in a chunk with a wrong
checksum are dropped, or kept with --unverified. Complete messages without a checksum are kept and
counted as unverified.

examples:
  collision-monitor salvage cut.mcap -o whole.mcap
  collision-monitor salvage cut.mcap -o whole.mcap --unverified --json

exit codes:
  0  nothing is missing
  1  nothing could be recovered
  2  wrong usage
  3  something is missing
"""


def add_parser(subparsers: Any) -> None:
    """Register the command and its options."""
    parser = subparsers.add_parser(
        "salvage",
        help="recover the complete messages of a damaged recording",
        description="Copy every complete message of a damaged MCAP file into a new file. The damaged file may be cut\n"
        "off or overwritten, or have flipped bits. Prints the number of messages of each topic, and every loss.",
        epilog=EPILOG,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("session", type=Path, metavar="SESSION", help="damaged .mcap file")
    parser.add_argument("-o", "--output", type=Path, required=True, metavar="OUT", help="new .mcap file")
    parser.add_argument("--unverified", action="store_true", help="also keep messages of chunks with a wrong checksum")
    add_force(parser, "OUT")
    parser.add_argument("--json", action="store_true", help="print the result as one JSON object")
    parser.set_defaults(command=salvage_command)


def salvage_command(args: argparse.Namespace) -> int:
    """Run the command and return the exit code. Raises SessionError."""
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
