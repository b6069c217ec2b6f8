"""`collision-monitor tune`: find the cheapest settings that meet demands on a recorded session."""

from __future__ import annotations

import argparse
import json
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any

from collision_monitor.cli.exit_codes import ExitCode
from collision_monitor.cli.output_file import writing
from collision_monitor.cli.progress import progress_bar
from collision_monitor.cli.quantities import positive
from collision_monitor.errors import InputError

if TYPE_CHECKING:
    from collision_monitor.accuracy.tune import Trial

EPILOG = """\
Every answer is compared with an exact one, which is recomputed at every step. The demands apply to
the worst contact, to 99 %% of the predictions and to 99 %% of the steps. A profile that misses a
collision, or states an interval without the exact time, is never chosen.

examples:
  collision-monitor tune run.mcap --max-ttc-error 0.05
  collision-monitor tune run.mcap --max-distance-error 0.02 --budget-ms 5 -o tuned.yaml --png tune.png

exit codes:
  0  a profile was found and written
  1  the session cannot be read, or a file cannot be written
  3  no profile meets the demands
"""


def add_parser(subparsers: Any) -> None:
    """Register the command and its options."""
    parser = subparsers.add_parser(
        "tune",
        help="find the cheapest settings that keep the errors small on a session",
        description="Find the cheapest tolerances that meet your demands on a recorded session. Prints a row for each\n"
        "profile that was tried, with the demands that it fails, and writes the chosen profile as a parameter\n"
        "file.",
        epilog=EPILOG.replace("%%", "%"),
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("session", type=Path, metavar="SESSION", help=".mcap file, or a folder that holds one session")
    parser.add_argument(
        "--max-distance-error", type=positive, metavar="M", help="largest error of a contact's distance (m)"
    )
    parser.add_argument(
        "--max-ttc-error", type=positive, metavar="S", help="largest error of a predicted time to collision (s)"
    )
    parser.add_argument("--budget-ms", type=positive, metavar="MS", help="largest time of a step on this machine (ms)")
    parser.add_argument(
        "-o", "--output", type=Path, metavar="FILE", help="parameter file (default: SESSION.yaml in the current folder)"
    )
    parser.add_argument("--force", action="store_true", help="overwrite the parameter file")
    parser.add_argument("--png", type=Path, metavar="FILE", help="draw time against error of each profile")
    parser.add_argument("--json", action="store_true", help="print one line of JSON")
    parser.set_defaults(command=tune_command)


def tune_command(args: argparse.Namespace) -> int:
    """Run the command and return the exit code. Raises InputError, SessionError."""
    from collision_monitor.accuracy.inputs import recorded
    from collision_monitor.accuracy.tune import Demands, candidates, parameter_file, tune
    from collision_monitor.session import Session

    output = args.output or Path(f"{args.session.stem}.yaml")
    if output.exists() and not args.force:
        raise InputError(f"{output}: expected a new file, got one that exists; choose another name or --force")
    demands = Demands(args.max_distance_error, args.max_ttc_error, args.budget_ms)
    profile = Session(args.session).profile
    name, descriptions, steps, _ = recorded(args.session)
    total = 2 * len(steps) * len(candidates(profile.horizon, profile.contact_margin))
    with progress_bar("tune", total) as done:
        chosen, trials = tune(
            name, descriptions, steps, demands,
            horizon=profile.horizon, contact_margin=profile.contact_margin, progress=done,
        )  # fmt: skip
    if args.json:
        rows = [each.measurement.to_dict() | {"failures": each.failures} for each in trials]
        print(json.dumps({"chosen": chosen and chosen.name, "demands": asdict(demands), "rows": rows}))
    else:
        print("\n".join(_as_text(trials, chosen.name if chosen else None)))
    if args.png:
        from collision_monitor.accuracy.pictures import draw_tradeoff

        with writing(args.png):
            draw_tradeoff([each.measurement for each in trials], args.png)
    if chosen is None:
        return ExitCode.NOT_AS_EXPECTED
    asked = ", ".join(f"{key} {value:g}" for key, value in asdict(demands).items() if value is not None)
    notes = [f"Found by `collision-monitor tune` on {args.session.name}: {chosen.name}", f"asked: {asked or 'nothing'}"]
    with writing(output):
        output.write_text(parameter_file(chosen, notes), encoding="utf-8")
    if not args.json:
        print(f"written {output}; start the node with: collision-monitor run --params {output}")
    return ExitCode.DONE


def _as_text(trials: list[Trial], chosen: str | None) -> list[str]:
    heads = ("ms/step", "p99", "alarms", "distance m", "TTC p99 s", "worst")
    widths = (8, 8, 9, 11, 10, 9)
    lines = [f"  {'profile':<16} " + " ".join(f"{head:>{width}}" for head, width in zip(heads, widths, strict=True))]
    for each in trials:
        row = each.measurement
        mark = "→ " if each.profile.name == chosen else "  "
        numbers = (
            row.step_ms,
            row.step_ms_p99,
            row.alarms,
            row.distance_error_m,
            row.ttc_error_s.p99,
            row.ttc_error_s.worst,
        )
        shown = " ".join(f"{x:>{w}.3g}" if x == x else f"{'–':>{w}}" for x, w in zip(numbers, widths, strict=True))
        lines.append(f"{mark}{each.profile.name:<16} {shown}  {'; '.join(each.failures) or 'meets all demands'}")
    if chosen is None:
        nearest = min(trials, key=lambda each: len(each.failures))
        lines.append(f"none meets all demands; {nearest.profile.name} comes nearest: {'; '.join(nearest.failures)}")
    return lines
