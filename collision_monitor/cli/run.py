"""`collision-monitor run`: run the monitor node."""

from __future__ import annotations

import argparse
from pathlib import Path

from collision_monitor.cli.options.parameter_file import check_parameter_file
from collision_monitor.cli.options.quantities import positive_number, size
from collision_monitor.cli.options.ros_arguments import parameters
from collision_monitor.cli.options.usage import UsageError, given_rules, usage
from collision_monitor.errors import SessionError
from collision_monitor.ros.executables import monitor
from collision_monitor.session.output_file import check_recording

DESCRIPTION = """\
Run the monitor as the ROS 2 node object_monitor. It subscribes to ~/objects/shapes and
~/objects/states, and publishes ~/contacts, ~/predictions, ~/status and ~/markers, and with --rules
~/alerts and ~/raised_alerts. It prints ROS log messages. Ctrl-C stops the node and completes the recording.
"""
EPILOG = """\
examples:
  collision-monitor run --params config/monitor.yaml
  collision-monitor run --sources sources.yaml            odometry, tf, tracks, scans: see `collision-monitor sources`
  collision-monitor run --rules config/rules.yaml         alerts by rules about who comes how near whom
  collision-monitor run --record shift_1 --split-size 500M            a rosbag2 folder of files
  collision-monitor run --record near_misses --on-event --before 20   one file per collision
  collision-monitor run --record run.mcap --ros-args -p horizon:=1.0 -r __ns:=/hall_2

ROS gets all arguments after --ros-args.

exit codes:
  0  stopped by Ctrl-C or SIGTERM
  1  --record cannot be used
  2  wrong usage, or the node refuses a parameter
"""


def add_parser(subparsers: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Register the command and its options."""
    parser = subparsers.add_parser(
        "run",
        help="run the monitor node",
        description=DESCRIPTION,
        epilog=EPILOG,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument(
        "--params", type=Path, metavar="FILE", help="parameter file (YAML), for example config/monitor.yaml"
    )
    parser.add_argument(
        "--sources", type=Path, metavar="FILE", help="sources file (YAML): topics of other programs to monitor"
    )
    parser.add_argument("--rules", type=Path, metavar="FILE", help="rules of the alerts (YAML), see docs/alerts.md")
    parser.add_argument(
        "--record", type=Path, metavar="PATH", help="record the session to a new .mcap file or a new folder"
    )
    parser.add_argument(
        "--split-size", type=size, metavar="SIZE", help="start a new file in the folder at this size, for example 500M"
    )
    parser.add_argument(
        "--split-duration", type=positive_number, metavar="S", help="start a new file in the folder every S seconds"
    )
    parser.add_argument(
        "--on-event", action="store_true", help="record only the time around collisions, each in its own file"
    )
    parser.add_argument(
        "--before",
        type=positive_number,
        metavar="S",
        help="with --on-event: time to keep before a collision begins (s, default: 10)",
    )
    parser.add_argument(
        "--after",
        type=positive_number,
        metavar="S",
        help="with --on-event: time to keep after it begins (s, default: 5)",
    )
    parser.add_argument("--profile", metavar="NAME", help="profile that sets the defaults: fast, balanced or exact")
    parser.add_argument("--ros-args", nargs=argparse.REMAINDER, default=[], metavar="…", help="arguments for ROS")
    parser.set_defaults(command=run_command)


def run_command(args: argparse.Namespace) -> int:
    """Run the node until SIGINT or SIGTERM. Raises UsageError, SessionError (no recording can be there)."""
    if args.record is not None and args.record.exists():
        raise SessionError(f"--record: expected the name of a new file, {args.record} is there already")
    if args.record is not None:
        check_recording(args.record, overwrite=False)
    several = args.split_size is not None or args.split_duration is not None or args.on_event
    if several and (args.record is None or args.record.suffix == ".mcap"):
        raise UsageError(
            f"--split-size, --split-duration, --on-event: expected --record with the name of a folder, "
            f"got {args.record or 'none'}; a name without .mcap makes one"
        )
    if (args.before or args.after) and not args.on_event:
        raise UsageError("--before and --after: expected with --on-event, got without")
    if args.params is not None:
        with usage():
            check_parameter_file(args.params)
    if args.rules is not None:
        given_rules(str(args.rules))
    found = [] if args.params is None else ["--params-file", str(args.params)]
    found += parameters(
        profile=args.profile,
        sources=args.sources,
        rules=args.rules,
        record=args.record,
        record_mode="on_event" if args.on_event else None,
        record_before=args.before,
        record_after=args.after,
        record_split_size=args.split_size,
        record_split_duration=args.split_duration,
    )
    return monitor(["collision-monitor", "--ros-args", *found, *args.ros_args])
