"""`collision-monitor echo`: print the messages of a topic, for installations without the command `ros2`."""

from __future__ import annotations

import argparse
import sys
import time
from typing import Any, Final

from collision_monitor.cli.options.quantities import positive_number, whole
from collision_monitor.cli.options.usage import UsageError
from collision_monitor.cli.output.error_line import print_error
from collision_monitor.cli.output.exit_codes import ExitCode
from collision_monitor.errors import CollisionMonitorError
from collision_monitor.ros.process import StopRequest, ros_context, stay_on_this_machine

LOOK: Final = 0.1
"""Time between two looks for a signal (s)."""

DESCRIPTION = """\
Print the messages of a topic as YAML until Ctrl-C: the command `ros2 topic echo` for installations from
wheels, which lack it. Of an array with more than --elements elements, it prints the first ones.
"""
EPILOG = """\
examples:
  collision-monitor echo --list                            all topics with their types
  collision-monitor echo /object_monitor/status --count 1
  collision-monitor echo /odom

exit codes:
  0  stopped by Ctrl-C or SIGTERM, or after --count messages
  1  nobody published the topic within --timeout, or its type is not installed
  2  wrong usage
"""


def add_parser(subparsers: Any) -> None:
    """Register the command and its options."""
    parser = subparsers.add_parser(
        "echo",
        help="print the messages of a topic",
        description=DESCRIPTION,
        epilog=EPILOG,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("topic", nargs="?", metavar="TOPIC", help="name of the topic")
    parser.add_argument("--list", action="store_true", help="list the topics with their types instead")
    parser.add_argument("--count", type=whole(1), metavar="N", help="end after so many messages")
    parser.add_argument(
        "--elements", type=whole(1), default=20, metavar="N", help="most elements of an array to print (default: 20)"
    )
    parser.add_argument(
        "--timeout", type=positive_number, default=5.0, metavar="S", help="time to wait for a publisher (s, default: 5)"
    )
    parser.set_defaults(command=echo_command)


def echo_command(args: argparse.Namespace) -> int:
    """Print until a signal and return the exit code. Raises UsageError, UnsupportedError."""
    if args.list == (args.topic is not None):
        raise UsageError(f"expected TOPIC or --list, got {'both' if args.list else 'neither'}")
    stop = StopRequest().install()
    stay_on_this_machine()
    with ros_context(["collision-monitor"]):
        from collision_monitor.ros.listening.topic_listener import TopicListener

        with TopicListener() as listener:
            if args.list:
                return _list(listener)
            topic = "/" + args.topic.strip("/")
            try:
                listener.subscribe(topic, args.elements, until=time.monotonic() + args.timeout, stop=stop)
            except CollisionMonitorError as error:
                print_error(error)
                return ExitCode.ERROR
            printed = 0
            while not stop.received and printed < (args.count or printed + 1):
                for text in listener.texts(LOOK)[: (args.count or sys.maxsize) - printed]:
                    print(f"{text}---", flush=True)
                    printed += 1
    return ExitCode.DONE


def _list(listener: Any) -> int:
    for topic, types in listener.topics():
        print(f"{topic}  {', '.join(types)}")
    return ExitCode.DONE
