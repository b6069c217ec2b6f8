"""`collision-monitor top`: the answers of a running monitor, live in this terminal."""

from __future__ import annotations

import argparse
import time
from typing import Any, Final

from collision_monitor.cli.options.quantities import positive_number
from collision_monitor.cli.options.usage import usage
from collision_monitor.cli.output.error_line import print_error
from collision_monitor.cli.output.exit_codes import ExitCode
from collision_monitor.errors import CollisionMonitorError
from collision_monitor.pipeline.topics import NODE
from collision_monitor.ros.process import StopRequest, ros_context, stay_on_this_machine

PATIENCE: Final = 10.0
"""Time to wait for the status of the monitor (s); it has one from its start on."""

DESCRIPTION = """\
Show what a running monitor publishes: the pairs that touch, those that will touch, soonest first, and
the cost of a step. It draws a table in a terminal, and prints one line per second otherwise. Ctrl-C
ends it; the monitor goes on.
"""
EPILOG = """\
examples:
  collision-monitor top
  collision-monitor top --monitor hall_2/object_monitor     a monitor in a namespace
  collision-monitor top --seconds 5 > log.txt               five lines

exit codes:
  0  stopped by Ctrl-C or SIGTERM, or after --seconds
  1  no monitor of that name published its status
  2  wrong usage
"""


def add_parser(subparsers: Any) -> None:
    """Register the command and its options."""
    parser = subparsers.add_parser(
        "top",
        help="show a running monitor in this terminal",
        description=DESCRIPTION,
        epilog=EPILOG,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument(
        "--monitor", default=NODE, metavar="NAME", help=f"name of the monitor's node, with its namespace ({NODE})"
    )
    parser.add_argument("--seconds", type=positive_number, metavar="S", help="end after this time (s)")
    parser.add_argument("--ros-args", nargs=argparse.REMAINDER, default=[], metavar="…", help="arguments for ROS")
    parser.set_defaults(command=top_command)


def top_command(args: argparse.Namespace) -> int:
    """Show the monitor until a signal and return the exit code. Raises UsageError, UnsupportedError."""
    stop = StopRequest().install()
    name = args.monitor.strip("/")
    stay_on_this_machine()
    with ros_context(["collision-monitor", *(["--ros-args", *args.ros_args] if args.ros_args else [])]):
        from collision_monitor.cli.output.live_show import FRAME, show_live
        from collision_monitor.ros.listening.viewer import Viewer

        with usage():
            viewer = Viewer(name)
        began = time.monotonic()
        while viewer.status is None and not stop.received and time.monotonic() - began < PATIENCE:
            viewer.listen(until=time.monotonic() + FRAME)
        is_heard = viewer.status is not None
        began, seconds = time.monotonic(), args.seconds or float("inf")
        if is_heard:
            show_live(viewer, f"/{name}", lambda: not stop.received and time.monotonic() - began < seconds)
        viewer.close()
    if not is_heard and not stop.received:
        print_error(
            CollisionMonitorError(
                f"expected a status of the monitor /{name} within {PATIENCE:g} s, got none: does it run, in this "
                "ROS_DOMAIN_ID and on this machine? `collision-monitor echo --list` lists the topics"
            )
        )
        return ExitCode.ERROR
    return ExitCode.DONE
