"""`collision-monitor conflicts`: all conflicts of whole plans with each other and with a static world."""

from __future__ import annotations

import argparse
import json
import sys
import time
from math import inf
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from collision_monitor.cli.options.quantities import not_negative, positive_number, whole
from collision_monitor.cli.output.exit_codes import ExitCode
from collision_monitor.cli.output.missing import print_missing
from collision_monitor.cli.output.output_file import add_force, check_outputs, check_picture, writing

if TYPE_CHECKING:
    from collision_monitor.query.conflicts.conflicts import Conflict
    from collision_monitor.query.conflicts.planned_scene import PlannedScene

MESHES: Final = (".stl", ".obj", ".ply", ".dae", ".glb")
"""Endings of meshes that --world takes, at the origin."""

SESSIONS: Final = (".mcap",)

DESCRIPTION = """\
Compare whole plans of many objects with each other and with a static world, ahead of time. Prints
every conflict with entry and exit, the soonest first. Times are s from the first point of all plans.
PLANS are plan files (YAML or JSON), sessions, or bags with an ObjectTrajectoryArray (MCAP).
"""

EPILOG = """\
examples:
  collision-monitor conflicts fleet.yaml --world hall.yaml
  collision-monitor conflicts north.yaml south.yaml --separation 0.2 --png conflicts.png
  collision-monitor conflicts run.mcap --json              plans that a monitor recorded

fleet.yaml:
  objects:
    agv_1:
      shape: {box: [1.2, 0.8, 0.5]}
      times: [0, 10, 12]                          # s
      poses: [[0, 0, 0], [10, 0, 0], [10, 2, 0]]  # x y z, or x y z qx qy qz qw
      headings: [0, 0, 1.57]                      # rad about z, in place of quaternions
    shelf: {static: true, shape: {box: [8, 1, 3]}, pose: [4, 3, 1.5]}

docs/conflicts.md explains each key. "unresolved": it is not certain whether the two meet.

exit codes:
  0  no conflict
  1  a file cannot be read or written
  2  wrong usage
  3  a conflict that is certain
  4  not known: conflicts are unresolved, or objects were left out, and none is certain
"""


def add_parser(subparsers: Any) -> None:
    """Register the command and its options."""
    parser = subparsers.add_parser(
        "conflicts",
        help="list the conflicts of plans of many objects, ahead of time",
        description=DESCRIPTION,
        epilog=EPILOG,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("plans", nargs="+", type=Path, metavar="PLANS", help="plan files, sessions or bags (MCAP)")
    parser.add_argument(
        "--world", type=Path, metavar="SCENE", help="a file whose static objects count, or a mesh (m, at the origin)"
    )
    parser.add_argument("--horizon", type=positive_number, metavar="S", help="end (s; default: that of the last plan)")
    parser.add_argument(
        "--separation", type=not_negative, default=0.0, metavar="M", help="a gap up to which it counts (m, default: 0)"
    )
    parser.add_argument("--rows", type=whole(1), default=40, metavar="N", help="rows of the table (default: 40)")
    parser.add_argument("--png", type=Path, metavar="FILE", help="draw the time line and the plans from above")
    add_force(parser, "the file of --png")
    parser.add_argument("--json", action="store_true", help="print all conflicts as one JSON object")
    parser.set_defaults(command=conflicts_command)


def conflicts_command(args: argparse.Namespace) -> int:
    """Run the command and return the exit code. Raises UsageError, InputError, SessionError, UnsupportedError."""
    from collision_monitor.query.conflicts.conflicts import conflicts

    check_picture("--png", args.png)
    check_outputs({"--png": args.png}, force=args.force, inputs=[*args.plans, args.world])
    scene = _read(args.plans, args.world)
    plans = scene.trajectories()
    shapes = {name: list(parts) for name, parts in scene.shapes.items()}
    static = {name: (list(parts), pose) for name, (parts, pose) in scene.static.items()}
    begin = time.perf_counter()
    found = conflicts(
        shapes, plans, static, args.horizon, separation=args.separation, ignore=scene.ignored
    )  # fmt: skip
    seconds = time.perf_counter() - begin
    if args.png is not None:
        from collision_monitor.report.plan_picture import draw_plans

        with writing(args.png):
            draw_plans(scene, plans, found, args.png)
    if args.json:
        print(json.dumps(_as_json(scene, found), indent=2))
    else:
        print_missing(scene.left_out)
        for line in _table(found, args.rows):
            print(line)
        certain = sum(each.status == "hit" for each in found)
        print(
            f"{len(plans)} plans, {len(static)} static objects: {certain} conflicts, {len(found) - certain} unresolved "
            f"({seconds:.2f} s)"
        )
    if any(each.status == "hit" for each in found):
        return ExitCode.NOT_AS_EXPECTED
    return ExitCode.NOT_KNOWN if found or scene.left_out else ExitCode.DONE


def _read(paths: list[Path], world: Path | None) -> PlannedScene:
    """Read all files. Raises InputError, SessionError."""
    from collision_monitor.errors import InputError
    from collision_monitor.query.conflicts.planned_scene import PlannedScene

    scene = PlannedScene()
    for path in paths:
        scene.add(_read_one(path), str(path))
    if not scene.plans:
        raise InputError(f"{', '.join(map(str, paths))}: expected at least one plan, got none")
    if world is not None:
        if world.suffix.lower() in MESHES:
            from collision_monitor.shapes.mesh_file import load_mesh
            from collision_monitor.shapes.pose import Pose

            scene.add(PlannedScene(static={world.stem: (((load_mesh(world), Pose()),), Pose())}), str(world))
        else:
            found = _read_one(world)
            if found.plans:
                print(f"{world}: {len(found.plans)} plans of --world are not used", file=sys.stderr)
            scene.add(PlannedScene(static=found.static), str(world))
    return scene


def _read_one(path: Path) -> PlannedScene:
    if path.suffix.lower() in SESSIONS or path.is_dir():
        from collision_monitor.session.recorded_plans import recorded_plans

        return recorded_plans(path)
    from collision_monitor.sources.plan_file import read_plan_file

    return read_plan_file(path)


def _as_json(scene: PlannedScene, found: list[Conflict]) -> dict[str, Any]:
    """All conflicts; a time that is infinite is null."""
    rows = []
    for each in found:
        touch = each.contact
        rows.append(
            {
                "a": each.a,
                "b": each.b,
                "status": each.status,
                "entry": [t if t < inf else None for t in each.entry],
                "exit": [t if t < inf else None for t in each.exit],
                "point": None if touch is None else touch.point_a.tolist(),
            }
        )
    counts = {"plans": len(scene.plans), "static": len(scene.static), "begin_ns": scene.begin_ns}
    return counts | {"left_out": scene.left_out, "conflicts": rows}


def _table(found: list[Conflict], most: int) -> list[str]:
    """The first rows, in 80 columns."""
    from collision_monitor.settings.names import shortened

    if not found:
        return []
    lines = [f"{'#':>4} {'from s':>9} {'until s':>10}  {'object':<16} {'and':<16} at x, y (m)"]
    for number, each in enumerate(found[:most], 1):
        touch = each.contact
        until = f"{each.exit[1]:10.3f}" if each.exit[1] < inf else f"{'the end':>10}"
        where = "" if touch is None else "{:.2f}, {:.2f}".format(*touch.point_a[:2].tolist())
        mark = " " if each.status == "hit" else "?"
        other = "anything" if each.b is None else shortened(str(each.b), 16)
        pair = f"{shortened(str(each.a), 16):<16} {other:<16}"
        lines.append(f"{number:4} {each.entry[0]:9.3f} {until}{mark} {pair} {where}")
    if any(each.status != "hit" for each in found[:most]):
        lines.append("?  unresolved: it is not certain whether the two meet")
    if len(found) > most:
        lines.append(f"and {len(found) - most} more; --rows shows more, --json all")
    return [line.rstrip() for line in lines]
