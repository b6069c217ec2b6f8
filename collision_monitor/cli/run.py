"""`collision-monitor run`: the monitor node."""

from __future__ import annotations

import argparse
from pathlib import Path

from collision_monitor.cli.parameter_file import check_parameter_file
from collision_monitor.cli.quantities import positive, size
from collision_monitor.cli.ros_arguments import parameters
from collision_monitor.errors import InputError, SessionError
from collision_monitor.ros.executables import monitor

DESCRIPTION = """\
Monitor objects: subscribes to ~/objects/shapes and ~/objects/states, publishes ~/contacts, ~/predictions, ~/status
and ~/markers (the node is named object_monitor). Ctrl-C stops it and finishes the recording.
"""
EPILOG = """\
Everything after --ros-args goes to ROS, for example:
  collision-monitor run --record run.mcap --ros-args -p horizon:=1.0 -r __ns:=/hall_2
  collision-monitor run --record shift_1 --split-size 500M            a folder of files, as ros2 bag record makes it
  collision-monitor run --record near_misses --on-event --before 20   one file for each time something touches
"""


def add_parser(subparsers: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Add the command to the `collision-monitor` parser."""
    parser = subparsers.add_parser(
        "run",
        help="run the monitor node",
        description=DESCRIPTION,
        epilog=EPILOG,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("--params", type=Path, metavar="FILE", help="parameters (YAML), such as config/monitor.yaml")
    parser.add_argument("--record", type=Path, metavar="PATH", help="write the session: a new .mcap file, or a folder")
    parser.add_argument("--split-size", type=size, metavar="SIZE", help="a new file from this size on, such as 500M")
    parser.add_argument("--split-duration", type=positive, metavar="S", help="a new file every S seconds")
    parser.add_argument("--on-event", action="store_true", help="keep only what is around collisions")
    parser.add_argument(
        "--before", type=positive, metavar="S", help="--on-event: so long before it begins (default: 10)"
    )
    parser.add_argument("--after", type=positive, metavar="S", help="--on-event: so long after it begins (default: 5)")
    parser.add_argument("--profile", metavar="NAME", help="where the settings start from: fast, balanced or exact")
    parser.add_argument("--ros-args", nargs=argparse.REMAINDER, default=[], metavar="…", help="passed on to ROS")
    parser.set_defaults(command=run_command)


def run_command(args: argparse.Namespace) -> int:
    """Run the node until SIGINT or SIGTERM. Raises InputError, SessionError for a recording that is there already."""
    if args.record is not None and args.record.exists():
        raise SessionError(f"--record: expected the name of a new file, {args.record} is there already")
    several = args.split_size is not None or args.split_duration is not None or args.on_event
    if several and (args.record is None or args.record.suffix == ".mcap"):
        raise SessionError(
            f"--split-size, --split-duration, --on-event: expected --record with the name of a folder, "
            f"got {args.record or 'none'}; a name without .mcap makes one"
        )
    if (args.before or args.after) and not args.on_event:
        raise InputError("--before and --after: expected with --on-event, got without")
    if args.params is not None:
        check_parameter_file(args.params)
    found = [] if args.params is None else ["--params-file", str(args.params)]
    found += parameters(
        profile=args.profile,
        record=args.record,
        record_mode="on_event" if args.on_event else None,
        record_before=args.before,
        record_after=args.after,
        record_split_size=args.split_size,
        record_split_duration=args.split_duration,
    )
    return monitor(["collision-monitor", "--ros-args", *found, *args.ros_args])
