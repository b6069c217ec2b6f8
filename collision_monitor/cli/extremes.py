"""`collision-monitor extremes`: measure the numerical error at extreme scales against exact answers."""

from __future__ import annotations

import argparse
import json
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any

from collision_monitor.cli.options.quantities import whole
from collision_monitor.cli.output.exit_codes import ExitCode
from collision_monitor.cli.output.output_file import add_force, check_outputs, check_picture, writing
from collision_monitor.cli.output.progress import progress_bar

if TYPE_CHECKING:
    from collision_monitor.accuracy.extremes import WorstCase

EPILOG = """\
columns:
  error   largest error against the exact answer (60 digits), relative to the sizes involved. For a
          time of impact it is relative to that time, with a tolerance of 1e-9 of the size.
  at      value on the scale at which the error is largest
  within  largest error relative to the bound that the answer states. For a time of impact: whether
          the interval contains the exact time. OUTSIDE: a bound is violated.

examples:
  collision-monitor extremes
  collision-monitor extremes --samples 50 --seed 7 --png extremes.png

exit codes:
  0  every number is finite and every exact answer is within its bound
  1  the picture cannot be written
  2  wrong usage
  3  a number is not finite, or an exact answer is outside its bound
"""


def add_parser(subparsers: Any) -> None:
    """Register the command and its options."""
    parser = subparsers.add_parser(
        "extremes",
        help="measure the numerical error from 1e-150 m to 1e18 m",
        description="Compare answers with exact ones over sizes, ratios, distances, gaps, speeds, angles and times.\n"
        "Prints a row for each scale and kind of answer.",
        epilog=EPILOG,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument(
        "--samples", type=whole(1), default=12, metavar="N", help="number of samples at each value (default: 12)"
    )
    parser.add_argument("--seed", type=whole(0), default=1, metavar="K", help="seed of the random numbers (default: 1)")
    parser.add_argument("--json", action="store_true", help="print one line of JSON")
    parser.add_argument(
        "--png", type=Path, metavar="FILE", help="draw the errors, one panel per scale (.png, .svg or .pdf)"
    )
    add_force(parser, "the picture")
    parser.set_defaults(command=extremes_command)


def extremes_command(args: argparse.Namespace) -> int:
    """Run the command and return the exit code. Raises UsageError, InputError, SessionError."""
    from collision_monitor.accuracy import extremes

    check_picture("--png", args.png)
    check_outputs({"--png": args.png}, force=args.force)
    with progress_bar("extremes", extremes.steps()) as done:
        rows = extremes.run(args.samples, args.seed, done)
    if args.json:
        print(json.dumps({"rows": [_as_json(row) for row in rows]}))
    else:
        print("\n".join(_as_text(rows)))
    if args.png is not None:
        from collision_monitor.accuracy.pictures import draw_extremes

        with writing(args.png):
            draw_extremes(rows, args.png)
    return ExitCode.DONE if all(row.holds for row in rows) else ExitCode.NOT_AS_EXPECTED


def _as_json(row: WorstCase) -> dict[str, Any]:
    values = asdict(row) | {"holds": row.holds}
    values["curve"] = [[x, y] for x, y in row.curve.items()]
    return values


def _as_text(rows: list[WorstCase]) -> list[str]:
    from collision_monitor.accuracy.extremes import SWEEPS

    lines = [
        f"{'scale':<24} {'from':>7} {'to':>7}  {'answer':<16} {'samples':>7} {'error':>8} {'at':>7}  {'within':>8}"
    ]
    last = ""
    for row in rows:
        unit, values, _ = SWEEPS.get(row.sweep, ("ns", [0.0, 2.0**63], None))
        name = f"{row.sweep} ({unit})" if unit else row.sweep
        start = f"{name:<24} {values[0]:7.0e} {values[-1]:7.0e}" if row.sweep != last else " " * 40
        within = "OUTSIDE" if row.ratio > 1.0 else "NOT FINITE" if row.not_finite else f"{row.ratio:8.2g}"
        lines.append(f"{start}  {row.quantity:<16} {row.samples:7d} {row.error:8.1e} {row.at:7.0e}  {within:>8}")
        last = row.sweep
    bad = sum(not row.holds for row in rows)
    samples = sum(row.samples for row in rows)
    verdict = "every truth is within its stated bound" if not bad else f"{bad} of {len(rows)} rows do not hold"
    return [*lines, f"{samples} answers: {verdict}"]
