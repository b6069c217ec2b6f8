"""`collision-monitor import`: make a session from a bag of another program."""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any

from collision_monitor.cli.options.usage import check_profiles, given_rules, usage
from collision_monitor.cli.output.exit_codes import ExitCode
from collision_monitor.cli.output.output_file import add_force

if TYPE_CHECKING:
    from collision_monitor.sources import Imported

DESCRIPTION = """\
Make a session from a bag of ROS 2 or ROS 1, and let the monitor answer it. The bag may hold odometry, poses, tf,
footprints, tracks, detections, markers and scans. A mapping file, which is the sources file of the
live node, gives the topic and the shape of each object:

  frame: map                       # frame of the session; other poses are transformed by the bag's tf
  stamps: header                   # or `received`: the time at which the bag received the message
  objects:
    cart:     {topic: /cart/odom, shape: {box: [1.2, 0.8, 0.5], at: [0, 0, 0.25]}}
    person_1: {topic: /tf, frame: person_1, shape: {capsule: [0.3, 1.1]}}
    crate:    {topic: /markers, marker: {ns: crates, id: 7}}         # with the shape of the marker
    walls:    {topic: /markers, marker: {ns: walls}, static: true}   # every marker of the namespace
    floor:    {static: true, shape: {half_space: [0, 0, 1, 0]}}

docs/sources.md explains every type and key. Without --map, the bag must hold the inputs of a
monitor, recorded by `ros2 bag record`. The command prints the number of states of each object, and
what was skipped or refused, with the reason.
"""
EPILOG = """\
examples:
  collision-monitor import bag --map map.yaml -o run.mcap
  collision-monitor import bag.mcap -o run.mcap --node object_monitor --profile exact

exit codes:
  0  everything was imported
  1  the bag cannot be imported, or OUT cannot be written
  2  wrong usage, or the mapping, the profile or the rules are not valid
  3  something was skipped or refused, or an object has no state
"""


def add_parser(subparsers: Any) -> None:
    """Register the command and its options."""
    parser = subparsers.add_parser(
        "import",
        help="make a session from a bag with odometry, poses, transforms or markers",
        description=DESCRIPTION,
        epilog=EPILOG,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument(
        "bag", type=Path, metavar="BAG", help=".mcap, .db3 or .bag (ROS 1) file, or the folder of a bag"
    )
    parser.add_argument("--map", type=Path, metavar="FILE", help="mapping file (YAML)")
    parser.add_argument("-o", "--output", type=Path, required=True, metavar="OUT", help="new session (.mcap)")
    parser.add_argument(
        "--profile",
        default="balanced",
        metavar="NAME",
        help="profile of the monitor: fast, balanced (default) or exact",
    )
    parser.add_argument("--rules", metavar="FILE", help="rules of the alerts (YAML), see docs/alerts.md")
    parser.add_argument(
        "--node", metavar="NAME", help="without --map: monitor whose inputs are imported, if there are several"
    )
    add_force(parser, "OUT")
    parser.add_argument("--json", action="store_true", help="print the result as one JSON object")
    parser.set_defaults(command=import_command)


def import_command(args: argparse.Namespace) -> int:
    """Run the command and return the exit code. Raises UsageError, SessionError, InputError."""
    from collision_monitor.session.output_file import check_recording
    from collision_monitor.sources import import_bag, load_mapping

    check_profiles([args.profile])
    with usage():
        mapping = None if args.map is None else load_mapping(args.map)
    rules = None if args.rules is None else given_rules(args.rules)
    read = [Path(each) for each in (args.bag, args.map, args.rules, args.profile) if each]
    check_recording(args.output, overwrite=args.force, inputs=read)
    with _progress() as progress:
        result = import_bag(
            args.bag,
            args.output,
            mapping,
            profile=args.profile,
            rules=rules,
            node=args.node,
            overwrite=args.force,
            progress=progress,
        )
    if args.json:
        print(json.dumps({"bag": str(args.bag), "output": str(args.output), **asdict(result)}, indent=2))
    else:
        print(_as_text(result, args.output))
    return ExitCode.DONE if result.whole else ExitCode.NOT_AS_EXPECTED


@contextmanager
def _progress() -> Iterator[Callable[[Imported], None] | None]:
    """Show the number of messages on stderr if it is a terminal."""
    if not sys.stderr.isatty():
        yield None
        return
    from rich.console import Console

    with Console(stderr=True).status("import") as status:

        def show(result: Imported) -> None:
            if result.messages % 256 == 0:
                status.update(f"import: {result.messages} messages, {result.steps} steps")

        yield show


def _as_text(result: Imported, output: Path) -> str:
    lines = [f"states     {count:8d}  {name}" for name, count in result.states.items()]
    lines += [f"skipped    {count:8d}  {reason}" for reason, count in result.skipped.items()]
    lines += [f"refused    {count:8d}  {reason.replace('_', ' ')}" for reason, count in result.refused.items()]
    if result.refused:
        lines.append(f"last       {result.last_refusal}")
    lines += [f"unseen     {name}: the bag has no message of it that could be used" for name in result.unseen]
    lines += [f"missing    {row.text}" for row in result.unmonitored]
    lines += [f"failed     an unexpected error; please report it with {path}" for path in result.failures]
    return "\n".join([*lines, f"written    {result.messages} messages, {result.steps} steps to {output}"])
