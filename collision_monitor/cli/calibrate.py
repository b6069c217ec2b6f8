"""`collision-monitor calibrate`: which motion model predicts a recording best, and how its errors grow."""

from __future__ import annotations

import argparse
import json
from pathlib import Path
from typing import TYPE_CHECKING, Any

from collision_monitor.cli.output.exit_codes import ExitCode
from collision_monitor.cli.output.missing import print_missing
from collision_monitor.cli.output.output_file import add_force, check_outputs, check_picture, writing
from collision_monitor.cli.output.progress import session_bar

if TYPE_CHECKING:
    from collision_monitor.accuracy.calibration.calibration import ClassCalibration

DESCRIPTION = """\
Compare motion models on the moving objects of a recording, by class: the name without the number at
its end. For each class it prints the errors of the predicted positions 0.5, 1 and 2 s ahead, the model
that predicts best, the standard deviations by which its errors grow, and the settings for a sources
file. Models are chosen and fitted on the first half of the recording and judged on the second half.
"""
EPILOG = """\
examples:
  collision-monitor calibrate run.mcap
  collision-monitor calibrate run.mcap --png errors.png

exit codes:
  0  done
  1  the recording cannot be read or has no class with enough states, or a file cannot be written
  2  wrong usage
"""


def add_parser(subparsers: Any) -> None:
    """Register the command and its options."""
    parser = subparsers.add_parser(
        "calibrate",
        help="find the motion model and the uncertainty of each class in a recording",
        description=DESCRIPTION,
        epilog=EPILOG,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("session", type=Path, metavar="SESSION", help=".mcap file, or a folder that holds one session")
    parser.add_argument("--png", type=Path, metavar="FILE", help="draw the errors of the models (.png, .svg or .pdf)")
    add_force(parser)
    parser.add_argument("--json", action="store_true", help="print one line of JSON")
    parser.set_defaults(command=calibrate_command)


def calibrate_command(args: argparse.Namespace) -> int:
    """Run the command and return the exit code. Raises UsageError, InputError, SessionError."""
    from collision_monitor.accuracy.calibration.calibration import calibrate, settings_text
    from collision_monitor.session import Session
    from collision_monitor.session.history.read_history import read_history

    check_picture("--png", args.png)
    check_outputs({"--png": args.png}, force=args.force, inputs=[args.session])
    session = Session(args.session)
    with session_bar("calibrate", session) as progress:
        history = read_history(session, progress=progress)
    print_missing(history.problems)
    found = calibrate(history)
    if args.json:
        print(json.dumps([_as_json(each) for each in found]))
    else:
        for each in found:
            _print_class(each)
        print(f"\n{settings_text(found)}")
    if args.png is not None:
        from collision_monitor.accuracy.calibration.picture import draw_calibration

        with writing(args.png):
            draw_calibration(found, args.png)
    return ExitCode.DONE


def _print_class(each: ClassCalibration) -> None:
    from collision_monitor.accuracy.calibration.calibration import LEADS

    heads = "".join(f"{f'{lead:g} s':>9}" for lead in LEADS)
    print(f"\n{each.name}: {each.objects} objects, {each.states} states\n  {'RMS error, second half (m)':<30}{heads}")
    for model in each.models:
        mark = "  chosen" if model is each.chosen else ""
        print(f"  {model.candidate!s:<30}{''.join(f'{value:9.3f}' for value in model.held_out)}{mark}")
    print(f"  {'within 95 % as fitted':<30}{''.join(f'{100 * value:8.1f}%' for value in each.within)}")


def _as_json(each: ClassCalibration) -> dict[str, Any]:
    return {
        "class": each.name,
        "objects": each.objects,
        "states": each.states,
        "motion": each.chosen.candidate.motion,
        "acceleration": each.chosen.candidate.acceleration,
        **{f"{name}_stddev": value for name, value in each.growth._asdict().items()},
        "within": list(each.within),
        "models": [
            {**model.candidate._asdict(), "fitted": list(model.fitted), "held_out": list(model.held_out)}
            for model in each.models
        ],
    }
