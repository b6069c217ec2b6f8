"""Options of the commands that take many sessions: how many at a time, and where."""

from __future__ import annotations

import argparse
from typing import TYPE_CHECKING

from collision_monitor.cli.quantities import whole

if TYPE_CHECKING:
    from collision_monitor.session.many import Engine


def add_engine(parser: argparse.ArgumentParser) -> None:
    """Add the options."""
    parser.add_argument("--jobs", type=whole(1), metavar="N", help="sessions at a time (default: one for each core)")
    parser.add_argument(
        "--engine", choices=("processes", "ray"), default="processes",
        help="where: processes of this machine (the default), or Ray, which is an extra: collision_monitor[ray]",
    )  # fmt: skip
    parser.add_argument(
        "--address", metavar="HOST:PORT",
        help="of a Ray cluster whose machines see the files under the same paths (default: Ray on this machine)",
    )  # fmt: skip


def engine_of(args: argparse.Namespace) -> Engine:
    """What the options say."""
    from collision_monitor.session.many import Engine

    return Engine(args.engine, args.jobs, args.address)
