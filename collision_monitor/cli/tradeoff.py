"""`collision-monitor tradeoff`: measure the time and the errors of each profile, on scenes or on a recorded session."""

from __future__ import annotations

import argparse
import csv
import json
import math
import sys
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from collision_monitor.accuracy.tradeoff.default_scenes import DEFAULT_SCENES
from collision_monitor.cli.options.quantities import not_negative, positive_number, whole
from collision_monitor.cli.options.usage import UsageError, check_profiles, check_unused, usage
from collision_monitor.cli.output.exit_codes import ExitCode
from collision_monitor.cli.output.missing import print_missing
from collision_monitor.cli.output.output_file import add_force, check_outputs, check_picture, writing
from collision_monitor.cli.output.progress import progress_anywhere, progress_bar

if TYPE_CHECKING:
    from collision_monitor.accuracy.inputs import Workload
    from collision_monitor.accuracy.tradeoff.measurement import Measurement

DESCRIPTION = """\
Measure the time and the errors of each profile. Every profile runs on scenes, or on a recorded
session. Each answer is compared with an exact one, which is recomputed at every step. The command
prints a row for each scene and profile: time per step, alarms, false alarms, misses, error of the
distance and of the time to collision (TTC), and the part of the answers whose bound holds. A line
for each scene then says how much there is to trade, and how many µs of a step no profile changes.
"""
EPILOG = """\
examples:
  collision-monitor tradeoff --scene fleet
  collision-monitor tradeoff --scene fleet --scene clutter --png tradeoff.png
  collision-monitor tradeoff run.mcap --profile fast --profile exact --json
  collision-monitor tradeoff --scene fleet --noise 0                      with exact states
  collision-monitor tradeoff --path ../shared/data/citr                   with recorded tracks too
  collision-monitor tradeoff --scene clutter --impact-methods             bisection, swept SAT, …
  collision-monitor tradeoff --scene arm --model obb --model convex_hull  models against the meshes
  collision-monitor tradeoff run.mcap --front --png front.png              the Pareto front of up to 18 settings

An alarm is a pair that is reported at a step, as a contact or as a prediction. It is false if the
pair does not touch within the horizon (`compare` and `tune` count the same). `beyond`: alarms that the
exact answers do not have at that step, most of them near misses within the tolerance of the profile.
The states of the scene fleet have the noise of a localiser, 5 mm, 5 mrad, 5 mm/s and 5 mrad/s, and
declare it.

exit codes:
  0  done
  1  the session cannot be used, or a file cannot be written
  2  wrong usage, or a scene refuses an option
"""


def add_parser(subparsers: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Register the command and its options."""
    parser = subparsers.add_parser(
        "tradeoff",
        help="measure the time and the errors of each profile",
        description=DESCRIPTION,
        epilog=EPILOG,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("session", nargs="?", type=Path, metavar="SESSION", help="recorded session, in place of scenes")
    parser.add_argument(
        "--scene",
        action="append",
        metavar="NAME",
        help=f"scene; may be repeated (default: {', '.join(DEFAULT_SCENES)})",
    )
    parser.add_argument("--path", type=Path, metavar="FILE", help="recorded tracks for the scene `trajectory`")
    parser.add_argument(
        "--noise", type=not_negative, metavar="S",
        help="standard deviation of the states (m, rad, m/s and rad/s; default: 0.005 for fleet, otherwise 0)",
    )  # fmt: skip
    parser.add_argument(
        "--objects", type=whole(1), metavar="N", help="number of moving objects (default: depends on the scene)"
    )
    parser.add_argument(
        "--seconds",
        type=positive_number,
        metavar="S",
        help="duration of each scene (s, default: 5, or all of the recorded tracks)",
    )
    parser.add_argument("--seed", type=whole(0), metavar="K", help="seed of the random numbers (default: 1)")
    parser.add_argument(
        "--profile", action="append", metavar="NAME",
        help="profile; may be repeated (default: all, and models of the shapes for the scene arm)",
    )  # fmt: skip
    parser.add_argument(
        "--model", action="append", metavar="NAME",
        help="measure models of the shapes against the exact shapes, in place of profiles; may be repeated",
    )  # fmt: skip
    parser.add_argument(
        "--impact-methods", action="store_true",
        help="measure the ways to find a time of impact on the pairs of the scenes, in place of profiles",
    )  # fmt: skip
    parser.add_argument(
        "--front", action="store_true",
        help="measure many settings of tolerances, models and uncertainty, and draw which of them no other one beats",
    )  # fmt: skip
    parser.add_argument("--json", action="store_true", help="print one line of JSON")
    parser.add_argument("--csv", type=Path, metavar="FILE", help="also write the rows to this file")
    parser.add_argument(
        "--png", type=Path, metavar="FILE", help="draw time against error, one panel per scene (.png, .svg or .pdf)"
    )
    add_force(parser)
    parser.set_defaults(command=tradeoff_command)


def tradeoff_command(args: argparse.Namespace) -> int:
    """Run the command and return the exit code. Raises UsageError, InputError, SessionError."""
    from collision_monitor.accuracy.inputs import recorded
    from collision_monitor.accuracy.tradeoff.tradeoff import tradeoff
    from collision_monitor.accuracy.tuning.front import summaries
    from collision_monitor.objects.models import parse_model
    from collision_monitor.settings.profile import Profile
    from collision_monitor.world.recorded_tracks import track_files

    if args.session is not None and args.scene:
        raise UsageError("tradeoff: expected a session or scenes, got both")
    if args.model and args.profile:
        raise UsageError("tradeoff: expected profiles or models, got both: --profile and --model")
    if args.front and (args.model or args.profile or args.csv or args.impact_methods):
        raise UsageError("tradeoff, --front: goes without --model, --profile, --csv and --impact-methods")
    if args.impact_methods and (args.model or args.profile or args.csv or args.png):
        raise UsageError("tradeoff, --impact-methods: goes without --model, --profile, --csv and --png")
    if args.session is not None:
        check_unused(args, ("path", "noise", "objects", "seconds", "seed"), "a session is measured as it was recorded")
    check_profiles(args.profile or ())
    with usage():
        for name in args.model or ():
            parse_model(name)
    check_picture("--png", args.png)
    read = [args.session, *track_files(args.path), *(args.profile or ())]
    check_outputs({"--csv": args.csv, "--png": args.png}, force=args.force, inputs=read)
    profiles = [Profile.named(name) for name in args.profile] if args.profile else None
    inputs: Iterable[Workload]
    if args.session is None:
        inputs = _scenes(args)
    else:
        inputs = [recorded(args.session)]
        print_missing(inputs[0].damage)
    if args.front:
        return _measure_fronts(args, inputs)
    if args.impact_methods:
        return _compare_impact_methods(args, inputs)
    rows = tradeoff(inputs, profiles, args.model, progress_bar)
    if args.json:
        print(json.dumps({"rows": [row.to_dict() for row in rows]}))
    else:
        _print_table(rows)
        print("\n".join(summaries(rows)))
    if args.csv:
        with writing(args.csv):
            _write_csv(rows, args.csv)
    if args.png:
        from collision_monitor.accuracy.pictures import draw_tradeoff

        with writing(args.png):
            draw_tradeoff(rows, args.png)
    return ExitCode.DONE


def _scenes(args: argparse.Namespace) -> Iterator[Workload]:
    """Yield the scenes. Raises UsageError if one does not exist or refuses an option."""
    from collision_monitor.accuracy.inputs import simulated

    with usage():
        seed = 1 if args.seed is None else args.seed
        yield from simulated(
            args.scene, objects=args.objects, seed=seed, path=args.path, noise=args.noise, duration=args.seconds
        )


def _measure_fronts(args: argparse.Namespace, inputs: Iterable[Workload]) -> int:
    """Print the rows of many settings for each scene, and what there is to trade."""
    from collision_monitor.accuracy.tuning.front import front_settings, measure_front

    fronts = []
    for work in inputs:
        settings = front_settings(work)
        with progress_anywhere(work.name, len(settings) + 2) as progress:
            fronts.append(measure_front(work, settings, progress))
    rows = [row for front in fronts for row in front.rows]
    if args.json:
        best = {each.label: {e: [row.profile for row in each.best(e)] for e in ("time", "distance")} for each in fronts}
        fixed = {each.label: each.fixed_us for each in fronts}
        print(json.dumps({"rows": [row.to_dict() for row in rows], "front": best, "fixed_us": fixed}))
    else:
        _print_table(rows)
        print("\n".join(each.summary() for each in fronts))
    if args.png:
        from collision_monitor.accuracy.tuning.front_picture import draw_fronts

        with writing(args.png):
            draw_fronts({each.label: [each] for each in fronts}, args.png)
    return ExitCode.DONE


def _compare_impact_methods(args: argparse.Namespace, inputs: Iterable[Workload]) -> int:
    """Print a row for each scene and way to find a time of impact."""
    from collision_monitor.accuracy.tradeoff.impact_tradeoff import METHODS, impact_tradeoff

    rows = []
    for work in inputs:
        with progress_bar(work.name, len(METHODS)) as progress:
            rows += impact_tradeoff(work, progress)
    if args.json:
        print(json.dumps({"rows": [row.to_dict() for row in rows]}))
        return ExitCode.DONE
    heads = ("pairs", 6), ("µs/call", 8), ("hits", 5), ("no hit", 6), ("late s", 8), ("early s", 8)
    print(f"{'scene':12} {'method':25} " + " ".join(f"{head:>{width}}" for head, width in heads))
    for row in rows:
        times = f"{_number(row.call_us):>8}" if row.pairs else f"{'–':>8}"
        print(
            f"{row.scene:12} {row.method:25} {row.pairs:6} {times} {row.hits:5} {row.missed:6} "
            f"{_number(row.late_s):>8} {_number(row.early_s):>8}"
        )
    return ExitCode.DONE


def _number(value: float) -> str:
    return "–" if value != value else f"{value:.2g}"


def _percent(part: float) -> str:
    return "–" if part != part else f"{math.floor(1e4 * part) / 100:g}"  # rounded down: 100 only if every bound holds


def _print_table(rows: Sequence[Measurement]) -> None:
    from rich import box
    from rich.console import Console
    from rich.table import Table

    from collision_monitor.accuracy.tradeoff.measurement import labels_of_models

    console = Console(width=None if sys.stdout.isatty() else 160)
    columns = [each for each in _COLUMNS if each not in _ONLY_WIDE or console.width >= WIDE]
    of_models = labels_of_models(rows)
    table = Table(box=box.SIMPLE_HEAD, pad_edge=False, padding=(0, 1 if console.width >= WIDE else 0, 0, 0))
    table.add_column("scene,\nprofile or model", overflow="fold")
    for name in columns:
        table.add_column(name, justify="right", no_wrap=True)
    scene = None
    for row in rows:
        if row.label != scene:
            if scene is not None:
                table.add_section()
            table.add_row(f"[bold]{row.label}[/bold]")
        scene = row.label
        values = _cells(row)
        table.add_row(f"  {row.model if scene in of_models else row.profile}", *(values[name] for name in columns))
    console.print(table)


WIDE: Final = 110
"""Columns of a terminal that shows all of a table's."""

_COLUMNS: Final = (
    *("ms/\nstep", "µs/\npair", "alarms\n", "false\n", "beyond\n", "missed\n", "distance\nerror m"),
    *("TTC s\nmedian", "TTC s\np99", "TTC s\nworst", "in\nbound %"),
)
_ONLY_WIDE: Final = ("µs/\npair", "TTC s\nmedian")


def _cells(row: Measurement) -> dict[str, str]:
    error = row.ttc_error_s
    values = (
        *(f"{row.step_ms:.3f}", f"{row.pair_us:.2f}"),
        *map(str, (row.alarms, row.false_alarms, row.beyond_exact, row.misses)),
        *map(_number, (row.distance_error_m, error.median, error.p99, error.worst)),
        _percent(row.within_bound),
    )
    return dict(zip(_COLUMNS, values, strict=True))


def _flat(row: Measurement) -> dict[str, Any]:
    values = row.to_dict()
    errors = values.pop("ttc_error_s")
    return {**values, **{f"ttc_error_{name}_s": value for name, value in errors.items()}}


def _write_csv(rows: Sequence[Measurement], path: Path) -> None:
    with path.open("w", newline="") as file:
        writer = csv.DictWriter(file, fieldnames=list(_flat(rows[0])))
        writer.writeheader()
        writer.writerows(map(_flat, rows))
