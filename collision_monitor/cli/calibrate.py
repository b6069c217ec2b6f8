"""`collision-monitor calibrate`: how the objects of a recording really moved, as settings."""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

from collision_monitor.cli.options.usage import UsageError
from collision_monitor.cli.output.exit_codes import ExitCode
from collision_monitor.cli.output.missing import print_missing
from collision_monitor.cli.output.output_file import add_force, check_outputs, check_picture, writing
from collision_monitor.cli.output.progress import progress_bar

if TYPE_CHECKING:
    from collision_monitor.accuracy.calibration.calibrate import Calibration
    from collision_monitor.accuracy.inputs import Workload

EPILOG = """\
For each class of objects, and for look-aheads up to 2 s, it compares where the objects were with
where each model of motion puts them: at rest; with constant velocity (people); on an arc with a
constant twist along their own axes; with the acceleration in the states, for ever (straight) or until
they stand (stops). Velocities are those of the states, or follow from the positions of 0.2, 0.5 or
1 s. The parts within 1 and 2 standard deviations (68 and 95 % if they are right) are those of each
half of the tracks by what the other half says. A class is the name of an object without its number:
person_12 and person_7 are of one.

examples:
  collision-monitor calibrate run.mcap
  collision-monitor calibrate monday.mcap tuesday.mcap --png motion.png
  collision-monitor calibrate run.mcap --class "person_*" --class "agv*"
  collision-monitor calibrate clips/                  recorded tracks in the format of CITR

exit codes:
  0  at least one class was calibrated
  1  a recording cannot be read, or a file cannot be written
  2  wrong usage
  4  no class has enough states
"""


def add_parser(subparsers: Any) -> None:
    """Register the command and its options."""
    parser = subparsers.add_parser(
        "calibrate",
        help="fit models of motion and standard deviations to a recording",
        description="Find which model of motion predicts the objects of a recording best, by class, and the standard\n"
        "deviations that say how far they are off it. Prints a table and the settings.",
        epilog=EPILOG,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument(
        "recordings", type=Path, nargs="+", metavar="RECORDING", help="session (.mcap), or a folder or clip of tracks"
    )
    parser.add_argument(
        "--class", dest="classes", action="append", default=[], metavar="PATTERN",
        help="names of objects of one class, with * and ?; several times for several (default: by their names)",
    )  # fmt: skip
    parser.add_argument("--png", type=Path, metavar="FILE", help="draw the deviations (.png, .svg or .pdf)")
    add_force(parser)
    parser.add_argument("--json", action="store_true", help="print one line of JSON")
    parser.set_defaults(command=calibrate_command)


def calibrate_command(args: argparse.Namespace) -> int:
    """Run the command and return the exit code. Raises UsageError, InputError, SessionError."""
    from collision_monitor.accuracy.calibration.calibrate import calibrate
    from collision_monitor.accuracy.calibration.tracks import tracks_by_class

    check_picture("--png", args.png)
    check_outputs({"--png": args.png}, force=args.force, inputs=args.recordings)
    works = [work for path in args.recordings for work in _read(path)]
    for work in works:
        print_missing(work.damage)
    classes = tracks_by_class(works, args.classes)
    for pattern in args.classes:
        if pattern not in classes:
            raise UsageError(f"--class: expected a pattern of names of objects that move, got {pattern!r:.100}, "
                             "which fits none")  # fmt: skip
    with progress_bar("calibrate", len(classes)) as advance:
        found, left_out = calibrate(classes, advance)
    for text in left_out:
        print(f"not calibrated: {text}", file=sys.stderr)
    if args.json:
        print(json.dumps({"classes": [each.as_json() for each in found], "left_out": left_out}))
    elif found:
        print("\n\n".join(_as_text(each) for each in found))
    if args.png and found:
        from collision_monitor.accuracy.calibration.calibration_picture import draw_calibration

        with writing(args.png):
            draw_calibration(found, args.png)
    return ExitCode.DONE if found else ExitCode.NOT_KNOWN


def _read(path: Path) -> Iterator[Workload]:
    """The steps of a session, or of each clip of recorded tracks at the path."""
    from collision_monitor.accuracy.inputs import recorded, simulated
    from collision_monitor.world.recorded_tracks import track_files

    if track_files(path):
        yield from simulated(["trajectory"], path=path, noise=0.0)
    else:
        yield recorded(path)


def _as_text(found: Calibration) -> str:
    from collision_monitor.accuracy.calibration.calibrate import FEW_TRACKS, SHOWN
    from collision_monitor.accuracy.calibration.deviation import LAGS

    columns = [LAGS.index(lag) for lag in SHOWN]
    lines = [f"{found.name}: {found.tracks} tracks, {found.states} states"]
    lines.append(f"  {'RMS deviation (m) after':<26}" + "".join(f"{f'{lag:g} s':>9}" for lag in SHOWN))
    for model, rms in found.rms.items():
        mark = "→" if model == found.chosen else " "
        cells = "".join(f"{'–' if rms[k] != rms[k] else f'{rms[k]:.3f}':>9}" for k in columns)
        lines.append(f"{mark} {model!s:<26}{cells}")
    for n, text in enumerate(("within 1 standard dev.", "within 2")):
        cells = "".join(
            f"{f'{100 * found.coverage[lag][n]:.0f} %' if lag in found.coverage else '–':>9}" for lag in SHOWN
        )
        lines.append(f"  {text:<26}{cells}")
    others = {lag: model for lag, model in found.best.items() if model != found.chosen}
    lines += [f"  at {lag:g} s, `{model}` is as good or better" for lag, model in others.items()]
    if len(set(found.choices)) > 1:
        lines.append(f"  the halves disagree: `{found.choices[0]}` and `{found.choices[1]}`")
    if found.tracks < FEW_TRACKS:
        lines.append(f"  {found.tracks} tracks are few: others may move otherwise")
    growth, (position, velocity) = found.growth, found.stated
    window = f"{found.chosen.window:g}"
    rows = (
        ("motion", found.chosen.motion, "of the entry in the sources file"),
        *((("estimate_over", window, "s: the velocity from the positions"),) if found.chosen.window else ()),
        ("position_stddev", f"{growth.position:.2g}", f"m, of the states, which say {position:.2g}"),
        ("velocity_stddev", f"{growth.velocity:.2g}", f"m/s, of the states, which say {velocity:.2g}"),
        ("max_linear_acceleration", f"{growth.most_acceleration:.2g}", "m/s², of the object's description"),
    )
    return "\n".join([*lines, "settings:", *(f"  {f'{name}: {value}':<31} # {unit}" for name, value, unit in rows)])
