"""`collision-monitor tune`: find the cheapest settings that meet demands on a recorded session."""

from __future__ import annotations

import argparse
import json
import os
import sys
from dataclasses import asdict
from pathlib import Path
from shlex import quote
from typing import TYPE_CHECKING, Any

from collision_monitor.cli.options.quantities import positive_number, whole
from collision_monitor.cli.options.usage import usage
from collision_monitor.cli.output.exit_codes import ExitCode
from collision_monitor.cli.output.missing import print_missing
from collision_monitor.cli.output.output_file import add_force, check_outputs, check_picture, writing
from collision_monitor.cli.output.progress import progress_anywhere

if TYPE_CHECKING:
    from collision_monitor.accuracy.tuning.demands import Demands
    from collision_monitor.accuracy.tuning.halving import Trial
    from collision_monitor.settings.profile import Profile

EPILOG = """\
The search covers all that a profile can say: tolerances of motion, impact and distance, uncertainty
and its number of samples, models of the shapes, budget and horizon. It measures many profiles on a
few parts of the session, the better half on twice as much, and the last three on all of it, on all
cores. Every answer is compared with an exact one, recomputed at each step. The demands apply to the
worst contact, to 99 % of the predictions and to 99 % of the steps. A profile that misses a collision,
or states a bound without the exact value, is never chosen.

examples:
  collision-monitor tune run.mcap --max-ttc-error 0.05
  collision-monitor tune run.mcap --max-distance-error 0.02 --budget-ms 5 -o tuned.yaml --png tune.png
  collision-monitor tune run.mcap --max-ttc-error 0.05 --max-probability-error 0.02    needs uncertainty

exit codes:
  0  a profile was found and written
  1  the session cannot be read, or a file cannot be written
  2  wrong usage: demands out of range, or that contradict the session
  3  no profile meets the demands
  4  a demand could not be tested, because the session has no such answers; no file is written
"""


def add_parser(subparsers: Any) -> None:
    """Register the command and its options."""
    parser = subparsers.add_parser(
        "tune",
        help="find the cheapest settings that keep the errors small on a session",
        description="Find the cheapest profile that meets your demands on a recorded session. Prints a row for each\n"
        "profile that was tried, with the demands that it fails, and three lines that explain the choice.\n"
        "Writes the chosen profile as a parameter file.",
        epilog=EPILOG,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("session", type=Path, metavar="SESSION", help=".mcap file, or a folder that holds one session")
    parser.add_argument(
        "--max-distance-error", type=positive_number, metavar="M", help="largest error of a contact's distance (m)"
    )
    parser.add_argument(
        "--max-ttc-error", type=positive_number, metavar="S", help="largest error of a predicted time to collision (s)"
    )
    parser.add_argument(
        "--budget-ms", type=positive_number, metavar="MS", help="largest time of a step on this machine (ms)"
    )
    parser.add_argument(
        "--max-probability-error", type=positive_number, metavar="P",
        help="largest standard error of a probability; keeps `uncertainty` on (default: probabilities are not needed)",
    )  # fmt: skip
    parser.add_argument(
        "--min-horizon", type=positive_number, metavar="S", help="shortest horizon (s, default: that of the session)"
    )
    parser.add_argument("-j", "--jobs", type=whole(1), metavar="N", help="number of processes (default: all cores)")
    parser.add_argument(
        "-o", "--output", type=Path, metavar="FILE", help="parameter file (default: SESSION.yaml in the current folder)"
    )
    parser.add_argument(
        "--png", type=Path, metavar="FILE", help="draw time against error of each profile (.png, .svg or .pdf)"
    )
    add_force(parser)
    parser.add_argument("--json", action="store_true", help="print one line of JSON")
    parser.set_defaults(command=tune_command)


def tune_command(args: argparse.Namespace) -> int:
    """Run the command and return the exit code. Raises UsageError, InputError, SessionError."""
    from collision_monitor.accuracy.inputs import recorded
    from collision_monitor.accuracy.tuning.demands import Demands
    from collision_monitor.accuracy.tuning.search_time import plan_search
    from collision_monitor.accuracy.tuning.tune import parameter_file, space_of, tune
    from collision_monitor.session import Session

    with usage():
        demands = Demands(
            args.max_distance_error, args.max_ttc_error, args.budget_ms, args.max_probability_error, args.min_horizon
        )
    output = args.output or Path(f"{args.session.stem}.yaml")
    check_picture("--png", args.png)
    check_outputs({"--output": output, "--png": args.png}, force=args.force, inputs=[args.session])
    cores = len(os.sched_getaffinity(0))
    jobs = args.jobs or cores
    work = recorded(args.session)
    print_missing(work.damage)
    with usage():
        space = space_of(work, Session(args.session).profile, demands)
    used = min(jobs, cores)
    plan = plan_search(work, space, used)
    print(f"tune: {len(work.steps)} steps, about {plan.seconds:.0f} s on {used} cores", file=sys.stderr, flush=True)
    found = tune(work, space, progress_anywhere, jobs, plan.run_seconds)
    chosen = found.chosen
    if args.json:
        rows = [
            each.measurement.to_dict() | {"failures": each.failures, "timed_alone": each.timed} for each in found.trials
        ]
        answer = {"chosen": chosen and chosen.name, "demands": asdict(demands), "reasons": found.reasons, "rows": rows}
        print(json.dumps(answer | {"untested": found.untested}))
    else:
        print("\n".join([*_as_text(found.trials, chosen, demands), "", *found.reasons]))
    if args.png:
        from collision_monitor.accuracy.tuning.front import Front
        from collision_monitor.accuracy.tuning.front_picture import draw_fronts

        front = Front([each.measurement for each in found.trials], fixed_us=float("nan"))
        with writing(args.png):
            draw_fronts({work.name: [front]}, args.png, chosen=chosen.name if chosen else None)
    if chosen is None:
        return ExitCode.NOT_AS_EXPECTED
    if found.untested:
        print("\n".join([*found.untested, "no file is written"]), file=sys.stderr)
        return ExitCode.NOT_KNOWN
    notes = [f"Found by `collision-monitor tune` on {args.session.name}", f"demands: {demands}", *found.reasons]
    with writing(output):
        output.write_text(parameter_file(chosen, notes), encoding="utf-8")
    if not args.json:
        print(f"written {output}; start the node with: collision-monitor run --params {quote(str(output))}")
    return ExitCode.DONE


def _figure(value: float) -> str:
    """A count whole, a number with three digits."""
    return "–" if value != value else str(value) if isinstance(value, int) else f"{value:.3g}"


def _as_text(trials: list[Trial], chosen: Profile | None, demands: Demands) -> list[str]:
    heads = ("ms/step", "p99", "alarms", "false", "distance m", "TTC p99 s", "steps")
    widths = (8, 8, 8, 8, 11, 10, 6)
    wide = max(len(each.profile.name) for each in trials)
    titles = " ".join(f"{head:>{width}}" for head, width in zip(heads, widths, strict=True))
    lines = [f"  {'profile':<{wide}} {titles}"]
    for each in trials:
        row = each.measurement
        mark = "→ " if each.profile is chosen else "  "
        numbers = (
            row.step_ms, row.step_ms_p99, row.alarms, row.false_alarms, row.distance_error_m, row.ttc_error_s.p99,
            row.steps,
        )  # fmt: skip
        shown = " ".join(f"{_figure(x):>{w}}" for x, w in zip(numbers, widths, strict=True))
        good = "meets what could be tested" if demands.untested(row) else "meets all demands"
        lines.append(f"{mark}{each.profile.name:<{wide}} {shown}  {'; '.join(each.failures) or good}")
    return lines
