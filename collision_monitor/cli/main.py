"""`collision-monitor`: parse the command line, run the command, and turn errors into one line and an exit code."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable, Sequence
from importlib import import_module
from keyword import iskeyword
from typing import Final

from collision_monitor._version import VERSION
from collision_monitor.cli.options.usage import UsageError
from collision_monitor.cli.output.error_line import print_error
from collision_monitor.cli.output.exit_codes import ExitCode
from collision_monitor.cli.output.output_streams import accept_any_text, discard_output
from collision_monitor.errors import CollisionMonitorError

COMMANDS: Final = (
    "demo", "run", "top", "echo", "view", "sources", "rules", "world", "replay", "report", "compare",
    "check", "conflicts", "salvage", "import", "tradeoff", "tune", "calibrate", "extremes", "bench", "warm-up",
)  # fmt: skip
"""Commands in the order of `--help`. Each is a module of this package (`import_` for import) with an `add_parser`."""

DESCRIPTION = """\
A ROS 2 collision monitor: reports which objects touch now, which will touch next, when, and with
which error bounds. Records sessions, replays them exactly, and analyses them.
"""

EPILOG = """\
examples:
  collision-monitor demo                                   live demo with a simulated scene
  collision-monitor run --record run.mcap                  run the monitor node and record a session
  collision-monitor top                                    show the running monitor in this terminal
  collision-monitor echo object_monitor/status             print the messages of a topic
  collision-monitor view                                   show the running monitor in the browser
  collision-monitor view run.mcap                          show a session, with a time line
  collision-monitor sources                                list topics of robots that it can monitor
  collision-monitor rules --live                           list the rules in force and whom they cover
  collision-monitor world --list                           list the simulated scenes
  collision-monitor world crossing                         publish one of them
  collision-monitor replay run.mcap                        replay without ROS and compare the answers
  collision-monitor report run.mcap                        write an HTML page about a session
  collision-monitor compare before.mcap after.mcap         list the differences of two sessions
  collision-monitor check run.mcap --expect expected.yaml  use a session as a regression test
  collision-monitor conflicts fleet.yaml                   list the conflicts of plans, ahead of time
  collision-monitor salvage cut.mcap -o whole.mcap         recover a damaged recording
  collision-monitor import bag --map map.yaml -o run.mcap  make a session from a bag
  collision-monitor tradeoff --scene fleet                 measure time and errors of each profile
  collision-monitor tune run.mcap --max-ttc-error 0.05     find the cheapest sufficient settings
  collision-monitor calibrate run.mcap                     fit models of motion to what objects did
  collision-monitor extremes                               measure errors at extreme scales
  collision-monitor bench --scene boxes --n 10000          measure the time to find all contacts
  collision-monitor warm-up                                compile the kernels in advance

exit codes:
  0    done
  1    error; one line on stderr explains it
  2    wrong usage: an option, a name or a file of settings that does not exist or cannot be used
  3    the result is not as expected, for example: answers differ, an expectation fails
  4    the result is not known, for example: a recording is incomplete
  130  interrupted

`collision-monitor COMMAND --help` explains each command.
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
        module = f"{name}_" if iskeyword(name) else name.replace("-", "_")
        import_module(f"collision_monitor.cli.{module}").add_parser(subparsers)
    return parser


def main(arguments: Sequence[str] | None = None) -> int:
    """Run a command line (default: sys.argv) and return the exit code."""
    accept_any_text()
    try:
        given = sys.argv[1:] if arguments is None else arguments
        _check_empty(given)
        try:
            args = make_parser().parse_args(given)
        except SystemExit:  # --help, --version
            sys.stdout.flush()
            raise
        command: Callable[[argparse.Namespace], int] = args.command
        code = command(args)
        sys.stdout.flush()
        return code
    except CollisionMonitorError as error:
        print_error(error)
        return ExitCode.USAGE if isinstance(error, UsageError) else ExitCode.ERROR
    except MemoryError as error:
        print_error(": ".join(filter(None, ("there is not enough memory for that", str(error)))))
        return ExitCode.ERROR
    except KeyboardInterrupt:
        return ExitCode.INTERRUPTED
    except BrokenPipeError:  # the reader (head, less) closed the pipe
        discard_output()
        return ExitCode.BROKEN_PIPE
    except OSError as error:  # a full disk behind stdout, for example
        discard_output()
        where = f"{error.filename}: " if error.filename else ""
        print_error(f"{where}{error.strerror or error}")
        return ExitCode.ERROR


def _check_empty(arguments: Sequence[str]) -> None:
    """Raise UsageError for an empty argument: as a path it would be the current folder, as a name the default."""
    before = "collision-monitor"
    for each in arguments:
        if each == "--ros-args":
            return
        name, _, value = each.partition("=")
        if not each or (name.startswith("--") and name != each and not value):
            raise UsageError(f"expected a value after `{each or before}`, got an empty text; is a variable not set?")
        before = each


def replay_main() -> int:
    """Entry point of `ros2 run collision_monitor replay …`. Returns the exit code."""
    return main(["replay", *sys.argv[1:]])
