"""`collision-monitor rules`: the rules of the alerts, in a file or in force, and whom each of them covers now."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Final

from collision_monitor.cli.options.quantities import positive_number
from collision_monitor.cli.options.usage import UsageError, given_rules, usage
from collision_monitor.cli.output.error_line import print_error
from collision_monitor.cli.output.exit_codes import ExitCode
from collision_monitor.errors import CollisionMonitorError
from collision_monitor.settings.parameter_file import NODE

DESCRIPTION = """\
List the rules of the alerts. With FILE, check a rules file and print what each rule limits. With
--live, print the rules that are in force in a running monitor, whom each of them covers at this
moment, and what it names and nothing monitors. Rules change while a monitor runs, and objects come
and go; a guard stops a robot that no rule covers.
"""
EPILOG = """\
examples:
  collision-monitor rules config/guard_rules.yaml
  collision-monitor rules --live
  collision-monitor rules --live --monitor hall_2/object_monitor

docs/alerts.md explains every key.

exit codes:
  0  done; with --live: each rule covers somebody, and all that it names is monitored
  1  with --live: no monitor of that name published its rules
  2  wrong usage, or the file cannot be used
  3  with --live: there are no rules, one covers nobody, or something that one names is not monitored
"""

_WIDTH: Final = 20


def add_parser(subparsers: Any) -> None:
    """Register the command and its options."""
    parser = subparsers.add_parser(
        "rules",
        help="list rules of the alerts, and whom those in force cover",
        description=DESCRIPTION,
        epilog=EPILOG,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("file", nargs="?", type=Path, metavar="FILE", help="rules file (YAML)")
    parser.add_argument("--live", action="store_true", help="the rules that are in force in a running monitor")
    parser.add_argument(
        "--monitor", metavar="NAME", help=f"with --live: name of the monitor's node, with its namespace ({NODE})"
    )
    parser.add_argument(
        "--timeout", type=positive_number, metavar="S", help="with --live: time to wait for the monitor (s, default: 5)"
    )
    parser.set_defaults(command=rules_command)


def rules_command(args: argparse.Namespace) -> int:
    """Run the command and return the exit code. Raises UsageError."""
    if args.live == (args.file is not None):
        raise UsageError(f"expected FILE or --live, got {'both' if args.live else 'neither'}")
    if args.live:
        return _print_live((args.monitor or NODE).strip("/"), args.timeout or 5.0)
    if args.monitor is not None or args.timeout is not None:
        raise UsageError("--monitor and --timeout: only with --live")
    from collision_monitor.alerts.rules_in_force import rule_values

    for rule in given_rules(str(args.file)).rules:
        _print_rule(rule.name, rule_values(rule))
    return ExitCode.DONE


def _print_live(monitor: str, seconds: float) -> int:
    from collision_monitor.ros.process import ros_context, stay_on_this_machine

    stay_on_this_machine()
    with ros_context(["collision-monitor"]):
        from collision_monitor.ros.health.line_report import DiagnosticLevel
        from collision_monitor.ros.listening.rules_listener import heard_rules

        with usage():
            found = heard_rules(monitor, seconds)
    if found is None:
        print_error(CollisionMonitorError(f"no monitor /{monitor} published its rules in {seconds:g} s: does it run?"))
        return ExitCode.ERROR
    for each in found:
        name = each.name.partition(": ")[2]
        if each.values:
            _print_rule(name, {value.key: value.value for value in each.values})
        else:
            print(each.message)
    whole = all(each.level == bytes([DiagnosticLevel.OK]) for each in found)
    for each in found:
        if each.level != bytes([DiagnosticLevel.OK]) and each.values:
            print(f"rule {each.name.partition(': ')[2]!r} {each.message}", file=sys.stderr)
    return ExitCode.DONE if whole else ExitCode.NOT_AS_EXPECTED


def _print_rule(name: str, values: Mapping[str, str]) -> None:
    print(f"{name}:")
    for key, value in values.items():
        print(f"  {key:<{_WIDTH}} {value}")
