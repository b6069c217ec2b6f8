"""`collision-monitor sources`: what is on the graph, a sources file to start from, and a check of one."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

from collision_monitor.cli.options.quantities import positive_number
from collision_monitor.cli.options.usage import usage
from collision_monitor.cli.output.exit_codes import ExitCode

if TYPE_CHECKING:
    from collision_monitor.ros.listening.survey import TopicFacts

DESCRIPTION = """\
List the topics on the ROS graph that the monitor understands, with their types, rates and frames, and
print a sources file to start from. It listens until no new topic has come for 2 s and each has been
heard; a topic without a rate had less than two messages. `collision-monitor run --sources FILE`
monitors what such a file names, and `collision-monitor import --map FILE` imports a bag with it.

With --check FILE, run the sources of a file for a while without a monitor, and report for each line
what arrived, how many states it gave, and what was refused.
"""
EPILOG = """\
examples:
  collision-monitor sources > sources.yaml        the file on stdout, the list on stderr
  collision-monitor sources --check sources.yaml
  collision-monitor run --sources sources.yaml

docs/sources.md explains every type and key.

exit codes:
  0  done; with --check: every line got messages and nothing was refused
  2  wrong usage, or the file cannot be used
  3  with --check: a line has a problem
"""


def add_parser(subparsers: Any) -> None:
    """Register the command and its options."""
    parser = subparsers.add_parser(
        "sources",
        help="list what is on the ROS graph and print a sources file to start from",
        description=DESCRIPTION,
        epilog=EPILOG,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("--check", type=Path, metavar="FILE", help="sources file (YAML) to check against the graph")
    parser.add_argument(
        "--seconds", type=positive_number, metavar="S",
        help="time to listen (s, default: until the graph is quiet; with --check 3)",
    )  # fmt: skip
    parser.set_defaults(command=sources_command)


def sources_command(args: argparse.Namespace) -> int:
    """Run the command and return the exit code. Raises InputError."""
    from collision_monitor.ros.process import ros_context, stay_on_this_machine

    if args.check is not None:
        return _check(args.check, args.seconds or 3.0)
    stay_on_this_machine()
    with ros_context(["collision-monitor"]):
        from collision_monitor.ros.listening.survey import survey
        from collision_monitor.sources.template import NOTHING

        found = survey(args.seconds)
    _print_list(found)
    text = _template(found)
    print(text, end="")
    if NOTHING in text:
        print("the file names no object yet, and `run --sources` needs one: fill in `objects`", file=sys.stderr)
    return ExitCode.DONE


def _check(path: Path, seconds: float) -> int:
    from collision_monitor.ros.process import ros_context, stay_on_this_machine
    from collision_monitor.sources.ground.mapping import load_mapping

    with usage():
        mapping = load_mapping(path)
    stay_on_this_machine()
    with ros_context(["collision-monitor"]):
        from collision_monitor.ros.listening.survey import check

        lines, missing = check(mapping, seconds)
    good = not missing
    for line in lines:
        is_implied = line.name == line.topic
        good = good and (is_implied or line.text == "ok")
        where = mapping.lines.get(line.name)
        head = f"line {where}" if where else "tf"
        print(f"{head:>8}  {line.name}: {line.topic} {line.type or '(no publisher)'}")
        text = line.text.removeprefix(f"{line.name}: ")
        print(f"          {line.messages} messages, {line.states} states, {line.refused} refused: {text}")
    for text in missing:
        print(f"not monitored: {text}")
    return ExitCode.DONE if good else ExitCode.NOT_AS_EXPECTED


def _print_list(found: list[TopicFacts]) -> None:
    """Print two lines for each topic, since its name is to be copied whole and may be long."""
    for each in found:
        frames = sorted(each.frames) or [f"{parent} → {child}" for child, parent in sorted(each.parents.items())[:6]]
        rate = f", {each.rate:.1f} Hz" if each.rate else ", no rate: less than two messages"
        missing = "" if each.installed else "; its package is not installed: make interfaces"
        print(each.topic, file=sys.stderr)
        kind = each.type.replace("/msg/", "/")
        print(f"    {kind}{missing or rate}{', frames: ' if frames else ''}{', '.join(frames)}", file=sys.stderr)
    if not found:
        print("no topic of a type that the monitor understands has a publisher", file=sys.stderr)


def _template(found: list[TopicFacts]) -> str:
    from collision_monitor.sources.template import Seen, sources_file

    parents: dict[str, str] = {}
    for each in found:
        parents |= each.parents
    seen = [
        Seen(each.topic, each.type, tuple(sorted(each.frames)), tuple(sorted(each.markers)), frozenset(each.moved))
        for each in found
    ]
    return sources_file(seen, parents)
