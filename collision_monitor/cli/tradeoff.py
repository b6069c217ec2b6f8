"""`collision-monitor tradeoff`: what each profile costs and how wrong it is, on scenes or on a recorded session."""

from __future__ import annotations

import argparse
import csv
import json
import math
import sys
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from collision_monitor.cli.progress import progress_bar
from collision_monitor.cli.quantities import not_negative, positive, whole
from collision_monitor.errors import InputError

if TYPE_CHECKING:
    from collision_monitor.accuracy.tradeoff import Row, Step
    from collision_monitor.objects.description import ObjectDescription

MESHES: Final = "arm"
"""The scene whose shapes matter, not its profile: its rows are models."""

TRACKS: Final = "trajectory"

SCENES: Final = ("fleet", "clutter", "swarm", "particles", "crossing", MESHES)
"""What is measured where no scene is named; and TRACKS, where a path is given."""

NOISE: Final = {"fleet": 0.005}
"""Of the states of scenes, where none is given. Of these scenes the true states are measured too, without a name."""

SECONDS: Final = 5.0

MOST_IN_LEGEND: Final = 4
"""Points of a panel; more have their names beside them."""

DESCRIPTION = """\
Run scenes, or a recorded session, through the profiles, and compare every answer with exact ones that are computed
anew at every step: time per step, false alarms, misses, errors of distance and of time to collision.
"""
EPILOG = """\
examples:
  collision-monitor tradeoff --scene fleet
  collision-monitor tradeoff --scene fleet --scene clutter --png tradeoff.png
  collision-monitor tradeoff run.mcap --profile fast --profile exact --json
  collision-monitor tradeoff --scene fleet --noise 0                         with true states in place of measured ones
  collision-monitor tradeoff --path ../shared/data/citr                      recorded tracks too
  collision-monitor tradeoff --scene arm --model obb --model convex_hull     models against the meshes themselves

A pair counts as an alarm at each step at which it is told, as a contact or as a prediction. A false alarm is one that
the exact answers do not have at that step: mostly a near miss, within the tolerance that the profile declares.
The states of the fleet are those of a localiser: off by 5 mm, 5 mrad, 5 mm/s and 5 mrad/s, and declared to be so.
"""


def add_parser(subparsers: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Add the command to the `collision-monitor` parser."""
    parser = subparsers.add_parser(
        "tradeoff",
        help="measure what each profile costs and how wrong it is",
        description=DESCRIPTION,
        epilog=EPILOG,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("session", nargs="?", type=Path, metavar="SESSION", help="a recording, in place of scenes")
    parser.add_argument(
        "--scene", action="append", metavar="NAME", help=f"may be given again (default: {', '.join(SCENES)})"
    )
    parser.add_argument("--path", type=Path, metavar="FILE", help="recorded tracks, for the scene `trajectory`")
    parser.add_argument(
        "--noise", type=not_negative, metavar="S",
        help="standard deviation of the states in m, rad, m/s and rad/s (default: 0.005 for the fleet, else 0)",
    )  # fmt: skip
    parser.add_argument("--objects", type=whole(1), metavar="N", help="how many move (default: the scene's own number)")
    parser.add_argument(
        "--seconds", type=positive, metavar="S", help="of each scene (default: 5, all of recorded tracks)"
    )
    parser.add_argument("--seed", type=whole(0), default=1, metavar="K", help="of the random numbers (default: 1)")
    parser.add_argument("--profile", action="append", metavar="NAME", help="may be given again (default: all)")
    parser.add_argument(
        "--model", action="append", metavar="NAME",
        help="compare models of the shapes with the shapes as they are, in place of profiles; may be given again",
    )  # fmt: skip
    parser.add_argument("--json", action="store_true", help="print one line of JSON")
    parser.add_argument("--csv", type=Path, metavar="FILE", help="write the rows there too")
    parser.add_argument("--png", type=Path, metavar="FILE", help="draw time against error, a panel for each scene")
    parser.set_defaults(command=run)


def run(args: argparse.Namespace) -> int:
    """Measure and print. Raises InputError, ProfileError, SessionError."""
    from collision_monitor.accuracy.tradeoff import recorded, tradeoff
    from collision_monitor.accuracy.tradeoff_models import MODELS, SAMPLES, model_tradeoff
    from collision_monitor.settings.profile import Profile

    if args.session is not None and args.scene:
        raise InputError("tradeoff: expected a session or scenes, got both")
    if args.model and args.profile:
        raise InputError("tradeoff: expected profiles or models, got both: --profile and --model")
    if args.session is not None and args.noise:
        raise InputError(
            f"tradeoff, --noise: a session is measured as it was recorded, leave it out (got {args.noise:g})"
        )
    profiles = [Profile.named(name) for name in args.profile or Profile.names()]
    if not args.profile:
        profiles.sort(key=lambda profile: -profile.impact_tolerance)
    inputs: Iterable[Any] = [(*recorded(args.session), 0.0)] if args.session else _played(args)
    rows = []
    for name, descriptions, steps, noise in inputs:
        if args.model or name == MESHES:
            models = args.model or MODELS
            with progress_bar(name, len(models) * len(steps) + min(SAMPLES, len(steps))) as progress:
                found = model_tradeoff(name, descriptions, steps, models, progress)
        else:
            with progress_bar(name, 2 * len(steps) * len(profiles)) as progress:
                found = tradeoff(name, descriptions, steps, profiles, progress)
        rows += [replace(row, noise=noise) for row in found]
    if args.json:
        print(json.dumps({"rows": [row.to_dict() for row in rows]}))
    else:
        _print_table(rows)
    try:
        if args.csv:
            _write_csv(rows, args.csv)
        if args.png:
            draw(rows, args.png)
    except OSError as error:
        raise InputError(f"expected a file that can be written, got {error.filename}: {error.strerror}") from None
    return 0


def _scenes(args: argparse.Namespace) -> list[tuple[str, float]]:
    """What to measure: names and the noise of the states."""
    names = args.scene or [*SCENES, *([TRACKS] if args.path else [])]
    if args.noise is not None:
        return [(name, args.noise) for name in names]
    chosen = [(name, NOISE.get(name, 0.0)) for name in names]
    return chosen if args.scene else [*((name, 0.0) for name in NOISE), *chosen]


def _played(args: argparse.Namespace) -> Iterator[tuple[str, list[ObjectDescription], list[Step], float]]:
    """Name, objects, steps and noise of each scene; of recorded tracks, each clip is one."""
    from collision_monitor.world import make_scene
    from collision_monitor.world.trajectory import clip_paths

    for name, noise in _scenes(args):
        for path in clip_paths(args.path) if name == TRACKS and args.path else [args.path]:
            scene = make_scene(name, objects=args.objects, seed=args.seed, path=path, noise=noise)
            seconds = SECONDS if scene.duration is None else scene.duration + 1.0 / scene.rate
            count = max(round((args.seconds or seconds) * scene.rate), 1)
            steps = [(0, scene.states())]
            while len(steps) < count and not scene.finished:
                states = scene.step()
                steps.append((round(scene.time * 1e9), states))
            yield path.stem if name == TRACKS else name, scene.descriptions, steps, noise


def _number(value: float) -> str:
    return "–" if value != value else f"{value:.2g}"


def _percent(part: float) -> str:
    return "–" if part != part else f"{math.floor(1e4 * part) / 100:g}"  # 100 only where all are


def _modelled(rows: Sequence[Row]) -> set[str]:
    """Labels of the scenes whose rows are models."""
    return {row.label for row in rows if row.model != "exact"}


def _print_table(rows: Sequence[Row]) -> None:
    from rich import box
    from rich.console import Console
    from rich.table import Table

    table = Table(box=box.SIMPLE_HEAD, pad_edge=False)
    for k, heading in enumerate(("scene", "profile\nor model", "ms/step", "µs/pair", "alarms", "false", "missed")):
        table.add_column(heading, justify="left" if k < 2 else "right", no_wrap=k > 0)
    for heading in ("distance\nerror m", "TTC error s\nmedian", "\np99", "\nworst", "in bound\n%"):
        table.add_column(heading, justify="right", no_wrap=True)
    models = _modelled(rows)
    scene = ""
    for row in rows:
        if scene and row.label != scene:
            table.add_section()
        shown = "" if row.label == scene else row.label
        scene = row.label
        error = row.ttc_error_s
        numbers = (row.distance_error_m, error.median, error.p99, error.worst)
        table.add_row(
            shown, row.model if scene in models else row.profile, f"{row.step_ms:.3f}", f"{row.pair_us:.2f}",
            str(row.alarms), str(row.false_alarms), str(row.misses), *map(_number, numbers), _percent(row.within_bound),
        )  # fmt: skip
    Console(width=None if sys.stdout.isatty() else 140).print(table)


def _flat(row: Row) -> dict[str, Any]:
    values = row.to_dict()
    errors = values.pop("ttc_error_s")
    return {**values, **{f"ttc_error_{name}_s": value for name, value in errors.items()}}


def _write_csv(rows: Sequence[Row], path: Path) -> None:
    with path.open("w", newline="") as file:
        writer = csv.DictWriter(file, fieldnames=list(_flat(rows[0])))
        writer.writeheader()
        writer.writerows(map(_flat, rows))


def draw(rows: Sequence[Row], path: Path) -> None:
    """Time against error, a panel for each scene. Raises OSError."""
    import matplotlib as mpl

    mpl.use("Agg")
    import matplotlib.pyplot as plt

    scenes = list(dict.fromkeys(row.label for row in rows))
    columns = min(len(scenes), 3)
    lines = -(-len(scenes) // columns)
    size = (4.0 * columns, 3.6 * lines)
    figure, panels = plt.subplots(lines, columns, figsize=size, squeeze=False, layout="constrained")
    for panel in panels.flat[len(scenes) :]:
        panel.remove()
    for panel, scene in zip(panels.flat, scenes, strict=False):
        if scene in _modelled(rows):
            _draw_models(panel, scene, [row for row in rows if row.label == scene])
            continue
        shown = [row for row in rows if row.label == scene and row.ttc_error_s.p99 > 0.0]
        panel.set(title=scene, xlabel="p99 error of the time to collision (s)", ylabel="ms per step")
        if not shown:
            panel.text(0.5, 0.5, "nothing predicted", ha="center", transform=panel.transAxes)
            continue
        for row in shown:
            panel.scatter(row.ttc_error_s.p99, row.step_ms, s=60, label=row.profile)
        times = [row.step_ms for row in shown]
        if max(times) > 5.0 * min(times):
            panel.set(xscale="log", yscale="log", ylim=(0.5 * min(times), 2.0 * max(times)))
        else:
            panel.set(xscale="log", ylim=(0.0, 1.5 * max(times)))
        if len(shown) <= MOST_IN_LEGEND:
            panel.legend(loc="lower left")
        else:
            for row in shown:
                at = (row.ttc_error_s.p99, row.step_ms)
                panel.annotate(row.profile, at, (0, 8), textcoords="offset points", rotation=60, fontsize=7)
        panel.grid(alpha=0.3)
    figure.savefig(path, dpi=120)
    plt.close(figure)


def _draw_models(panel: Any, scene: str, rows: Sequence[Row]) -> None:
    """Time against the error of the distance, both over some orders of magnitude."""
    panel.set(title=scene, xlabel="worst error of the distance (m)", ylabel="ms per step", yscale="log")
    panel.set_xscale("symlog", linthresh=1e-3)  # the shapes as they are have none
    for row in rows:
        panel.scatter(row.distance_error_m, row.step_ms, s=60, label=row.model)
    panel.legend(loc="upper right")
    panel.grid(alpha=0.3)
