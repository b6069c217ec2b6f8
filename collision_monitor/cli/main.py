"""`collision-monitor`: parse the command line, run the command, turn errors into one line and an exit code."""

from __future__ import annotations

import argparse
import os
import sys
from collections.abc import Callable, Sequence
from importlib import import_module
from keyword import iskeyword
from typing import Final

from collision_monitor._version import VERSION
from collision_monitor.cli.exit_codes import ExitCode
from collision_monitor.errors import CollisionMonitorError

COMMANDS: Final = (
    "demo", "run", "world", "replay", "report", "compare",
    "check", "salvage", "import", "tradeoff", "tune", "extremes", "bench",
)  # fmt: skip
"""In the order of `--help`. Each is a module of this package (`import_` for import) with `add_parser(subparsers)`."""

DESCRIPTION = "What touches now, what will touch next, when, and how sure that is: a ROS 2 collision monitor."

EPILOG = """\
examples:
  collision-monitor demo                                  a scene and a monitor, live in this terminal
  collision-monitor run --record run.mcap                 the monitor node, recording what it sees and says
  collision-monitor world --list                          the scenes that can be played to it
  collision-monitor world crossing                        play one of them
  collision-monitor replay run.mcap                       the same answers again, without ROS; differences are shown
  collision-monitor report run.mcap                       what happened, as one HTML page
  collision-monitor compare before.mcap after.mcap        what changed between two sessions, or two profiles on one
  collision-monitor check run.mcap --expect expected.yaml recorded sessions as regression tests
  collision-monitor salvage cut.mcap -o whole.mcap        what is whole in a damaged recording
  collision-monitor import bag --map map.yaml -o run.mcap odometry, poses, tf or markers as a session
  collision-monitor tradeoff --scene fleet                what each profile costs and how wrong it is
  collision-monitor tune run.mcap --max-ttc-error 0.05    the cheapest settings that are good enough
  collision-monitor extremes                              how right the numbers are from 1e-150 m to 1e18 m
  collision-monitor bench --scene boxes --n 10000         how long it takes to find all contacts

exit codes: 0 done, 1 error, 2 wrong usage, 130 interrupted; 3 not as expected: replay and compare, the answers differ;
check, an expectation does not hold; salvage, something is missing; 4 cannot be told: replay, the answers cannot be
compared; compare, not all is known
`collision-monitor COMMAND --help` says more about each command.
"""


def make_parser() -> argparse.ArgumentParser:
    """Return the parser with every command registered."""
    parser = argparse.ArgumentParser(
        prog="collision-monitor",
        description=DESCRIPTION,
        epilog=EPILOG,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("--version", action="version", version=f"%(prog)s {VERSION}")
    subparsers = parser.add_subparsers(title="commands", metavar="COMMAND", required=True)
    for name in COMMANDS:
        module = f"{name}_" if iskeyword(name) else name
        import_module(f"collision_monitor.cli.{module}").add_parser(subparsers)
    return parser


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line (default: the process's own) and return the exit code."""
    try:
        args = make_parser().parse_args(arguments)
        command: Callable[[argparse.Namespace], int] = args.command
        code = command(args)
        sys.stdout.flush()
        return code
    except CollisionMonitorError as error:
        print(f"collision-monitor: error: {error}", file=sys.stderr)
        return ExitCode.ERROR
    except MemoryError as error:
        print(f"collision-monitor: error: there is not enough memory for that: {error}", file=sys.stderr)
        return ExitCode.ERROR
    except KeyboardInterrupt:
        return ExitCode.INTERRUPTED
    except BrokenPipeError:
        # The reader (head, less) went away. Point stdout elsewhere, or Python complains again when it exits.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return ExitCode.BROKEN_PIPE


def replay_main() -> int:
    """`ros2 run collision_monitor replay …`: the command of that name."""
    return main(["replay", *sys.argv[1:]])
