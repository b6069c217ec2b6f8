"""`collision-monitor run`: the monitor node."""

from __future__ import annotations

import argparse
from pathlib import Path

from collision_monitor.cli.parameter_file import check_parameter_file
from collision_monitor.cli.ros_arguments import parameters
from collision_monitor.errors import SessionError
from collision_monitor.ros.main import monitor

DESCRIPTION = """\
Monitor objects: subscribes to ~/objects/shapes and ~/objects/states, publishes ~/contacts, ~/predictions, ~/status
and ~/markers (the node is named object_monitor). Ctrl-C stops it and finishes the recording.
"""
EPILOG = """\
Everything after --ros-args goes to ROS, for example:
  collision-monitor run --record run.mcap --ros-args -p horizon:=1.0 -r __ns:=/hall_2
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
    parser.add_argument("--record", type=Path, metavar="PATH", help="write the session to this new .mcap file")
    parser.add_argument("--profile", metavar="NAME", help="where the settings start from: fast, balanced or exact")
    parser.add_argument("--ros-args", nargs=argparse.REMAINDER, default=[], metavar="…", help="passed on to ROS")
    parser.set_defaults(command=run)


def run(args: argparse.Namespace) -> int:
    """Run the node until SIGINT or SIGTERM. Raises InputError, SessionError for a recording that is there already."""
    if args.record is not None and args.record.exists():
        raise SessionError(f"--record: expected the name of a new file, {args.record} is there already")
    if args.params is not None:
        check_parameter_file(args.params)
    found = [] if args.params is None else ["--params-file", str(args.params)]
    found += parameters(profile=args.profile, record=args.record)
    return monitor(["collision-monitor", "--ros-args", *found, *args.ros_args])
