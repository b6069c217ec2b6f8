"""`collision-monitor bench`: measure the time of full contact detection, with new poses in every frame."""

from __future__ import annotations

import argparse
import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from collision_monitor.accuracy.detection_time import WARM_UP_FRAMES
from collision_monitor.cli.options.quantities import positive_number, whole
from collision_monitor.cli.options.usage import UsageError, usage
from collision_monitor.cli.output.exit_codes import ExitCode

HARD_SPHERES = ("hard-spheres", "hard_spheres")

MOST_BODIES = 10_000_000
"""Their poses in 12 frames take 7 GB."""

DESCRIPTION = """\
Measure how long it takes to find all contacts of N moving bodies.

Every pose is new in every frame. The input is NumPy arrays of poses; the output is NumPy arrays of
pairs, signed distances, normals and points. The bodies move and turn at random, and the density of
contacts does not depend on N. The command prints the median and the 99th percentile of the time
per frame, and the number of colliding pairs.

The scene hard-spheres measures the event-driven simulation instead: collisions per second on one
core, the relative drift of the energy, and the pressure, with that of Carnahan and Starling.
"""
EPILOG = """\
examples:
  collision-monitor bench --scene boxes --n 10000
  collision-monitor bench --scene hulls --n 1000 --threads 1 --json
  collision-monitor bench --n 2000 --broad-phase all        why the grid is the default
  collision-monitor bench --scene-file scene.npz --json
  collision-monitor bench --scene hard-spheres --n 4000 --packing 0.25 --json

exit codes:
  0  done
  1  the file of the scene cannot be used
  2  wrong usage
"""


def add_parser(subparsers: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Register the command and its options."""
    parser = subparsers.add_parser(
        "bench",
        help="measure the time to find all contacts",
        description=DESCRIPTION,
        epilog=EPILOG,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument(
        "--scene", default="boxes", metavar="NAME", help="boxes (default), spheres, mixed, hulls or hard-spheres"
    )
    parser.add_argument(
        "--n", type=whole(1, MOST_BODIES), default=10_000, metavar="N", help="number of bodies (default: 10000)"
    )
    parser.add_argument("--seed", type=whole(0), default=1, metavar="S", help="seed of the random scene (default: 1)")
    parser.add_argument("--scene-file", type=Path, metavar="FILE", help="measure a saved scene (.npz) instead")
    parser.add_argument(
        "--frames",
        type=whole(WARM_UP_FRAMES + 1),
        metavar="F",
        help=f"number of frames; the first {WARM_UP_FRAMES} of them are not counted (default: 12)",
    )
    parser.add_argument(
        "--threads", type=whole(1), metavar="T", help="number of threads (default: 2, or 1 on a single core)"
    )
    parser.add_argument(
        "--packing",
        type=positive_number,
        metavar="P",
        help="part of space that hard spheres fill (default: 0.45); for hard-spheres only",
    )
    parser.add_argument(
        "--broad-phase",
        metavar="NAME",
        help="another broad phase than the grid, on one thread, or `all` to compare them (see docs/geometry.md)",
    )
    parser.add_argument("--json", action="store_true", help="print one line of JSON")
    parser.set_defaults(command=bench_command)


def bench_command(args: argparse.Namespace) -> int:
    """Run the benchmark, print the result and return the exit code. Raises UsageError, InputError."""
    from collision_monitor.accuracy.detection_time import time_detection
    from collision_monitor.detection.detector import default_threads
    from collision_monitor.detection.partitioned import BROAD_PHASES, MOST_FOR_BRUTE_FORCE
    from collision_monitor.world.moving_bodies import (
        BENCHMARK_SCENES,
        FRAMES,
        load_moving_bodies,
        make_moving_bodies,
    )

    if args.scene_file is None and args.scene in HARD_SPHERES:
        return _bench_hard_spheres(args)
    _check_choice("scene", args.scene, (*BENCHMARK_SCENES, HARD_SPHERES[0]))
    _check_choice("--broad-phase", args.broad_phase or "all", (*BROAD_PHASES, "all"))
    if args.packing is not None:
        raise UsageError("--packing: expected the scene hard-spheres, other scenes have a fixed density")
    if args.scene_file is None:
        with usage():
            scene = make_moving_bodies(args.scene, args.n, args.seed, args.frames or FRAMES)
    else:
        scene = load_moving_bodies(args.scene_file)
    threads = default_threads() if args.threads is None else args.threads
    if args.broad_phase is None:
        with usage():
            result = time_detection(scene, threads, args.frames)
        _print(result, args.json)
        return ExitCode.DONE
    names = BROAD_PHASES if args.broad_phase == "all" else (args.broad_phase,)
    for name in names:
        if args.broad_phase == "all" and name == "brute-force" and len(scene.shapes) > MOST_FOR_BRUTE_FORCE:
            continue
        with usage():
            result = time_detection(scene, threads if name == "grid" else 1, args.frames, name)
        _print({**result, "broad_phase": name}, args.json)
    return ExitCode.DONE


def _check_choice(option: str, value: str, choices: Sequence[str]) -> None:
    if value not in choices:
        raise UsageError(f"{option}: expected one of {', '.join(choices)}, got {value!r}")


def _bench_hard_spheres(args: argparse.Namespace) -> int:
    from collision_monitor.accuracy.collision_rate import PACKING, measure_collision_rate

    for name in ("frames", "threads", "broad_phase"):
        if getattr(args, name) is not None:
            option = name.replace("_", "-")
            raise UsageError(f"--{option}: expected no value with hard-spheres: one event list, one thread")
    with usage():
        result = measure_collision_rate(args.n, PACKING if args.packing is None else args.packing, args.seed)
    if args.json:
        print(json.dumps(result))
    else:
        print(
            f"hard spheres, {result['n']} at packing {result['packing']:g}: "
            f"{result['collisions_per_s']:,.0f} collisions per second, energy drift {result['energy_drift']:.1e}, "
            f"pressure {result['pressure']:.4f} Pa, compressibility {result['compressibility']:.4f} "
            f"(Carnahan-Starling {result['carnahan_starling']:.4f})"
        )
    return ExitCode.DONE


def _print(result: dict[str, Any], as_json: bool) -> None:
    if as_json:
        print(json.dumps(result), flush=True)
        return
    chosen = f", {result['broad_phase']}" if "broad_phase" in result else ""
    print(
        f"{result['scene']}, {result['n']} objects, {result['threads']} thread{'s'[: result['threads'] > 1]}{chosen}: "
        f"{result['median_ms']:.3f} ms per frame (p99 {result['p99_ms']:.3f} ms over {result['frames']} frames), "
        f"{result['pairs']} colliding pairs",
        flush=True,
    )
