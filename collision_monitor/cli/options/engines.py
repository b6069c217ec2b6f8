"""Options of the commands that process many sessions in parallel."""

from __future__ import annotations

import argparse
from typing import TYPE_CHECKING, Final

from collision_monitor.cli.options.quantities import whole
from collision_monitor.cli.options.usage import UsageError

if TYPE_CHECKING:
    from collision_monitor.session.many_sessions import Engine


RAY: Final = "ray"


def add_engine(parser: argparse.ArgumentParser) -> None:
    """Add the options to a command."""
    parser.add_argument(
        "--jobs", type=whole(1), metavar="N", help="number of sessions at a time (default: one per core)"
    )
    parser.add_argument(
        "--engine", choices=("processes", RAY), default="processes",
        help="run in processes on this machine (default), or on Ray (needs `pip install '.[ray]'`)",
    )  # fmt: skip
    parser.add_argument(
        "--address", metavar="HOST:PORT",
        help="Ray cluster; its machines must see the files under the same paths (default: Ray on this machine)",
    )  # fmt: skip


def engine_of(args: argparse.Namespace) -> Engine:
    """Return the engine that the options select. Raises UsageError for an address without Ray."""
    from collision_monitor.session.many_sessions import Engine

    if args.address is not None and args.engine != RAY:
        raise UsageError(f"--address: expected --engine {RAY}, whose cluster it names, got --engine {args.engine}")
    return Engine(args.engine, args.jobs, args.address)
