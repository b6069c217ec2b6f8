"""`collision-monitor bench`: how long full detection takes, every pose new in each frame."""

from __future__ import annotations

import argparse
import json
from pathlib import Path

from collision_monitor.accuracy.detection_time import WARM_UP_FRAMES
from collision_monitor.cli.exit_codes import ExitCode
from collision_monitor.cli.quantities import whole

DESCRIPTION = """\
Time full detection: NumPy poses in, NumPy pairs, distances, normals and points out, every pose new in each frame.
The scenes move and turn at random at a fixed contact density; the time told is the median over the frames.
"""
EPILOG = """\
examples:
  collision-monitor bench --scene boxes --n 10000
  collision-monitor bench --scene hulls --n 1000 --threads 1 --json
  collision-monitor bench --scene-file scene.npz --json
"""


def add_parser(subparsers: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Add the command to the `collision-monitor` parser."""
    parser = subparsers.add_parser(
        "bench",
        help="time the detection of all contacts",
        description=DESCRIPTION,
        epilog=EPILOG,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("--scene", default="boxes", metavar="NAME", help="boxes (default), spheres, mixed or hulls")
    parser.add_argument("--n", type=whole(1), default=10_000, metavar="N", help="how many objects (default: 10000)")
    parser.add_argument("--seed", type=whole(0), default=1, metavar="S", help="of the random scene (default: 1)")
    parser.add_argument("--scene-file", type=Path, metavar="FILE", help="a saved scene (.npz) instead")
    parser.add_argument(
        "--frames", type=whole(1), metavar="F", help=f"frames, {WARM_UP_FRAMES} uncounted (default: 12)"
    )
    parser.add_argument("--threads", type=whole(1), metavar="T", help="default: 2, or 1 where there is one core")
    parser.add_argument("--json", action="store_true", help="print one line of JSON")
    parser.set_defaults(command=bench_command)


def bench_command(args: argparse.Namespace) -> int:
    """Run the benchmark. Raises InputError."""
    from collision_monitor.accuracy.detection_time import time_detection
    from collision_monitor.detection.detector import default_threads
    from collision_monitor.world.moving_bodies import FRAMES, load_moving_bodies, make_moving_bodies

    if args.scene_file is None:
        scene = make_moving_bodies(args.scene, args.n, args.seed, args.frames or FRAMES)
    else:
        scene = load_moving_bodies(args.scene_file)
    result = time_detection(scene, default_threads() if args.threads is None else args.threads, args.frames)
    if args.json:
        print(json.dumps(result))
    else:
        print(
            f"{result['scene']}, {result['n']} objects, {result['threads']} thread{'s'[: result['threads'] > 1]}: "
            f"{result['median_ms']:.3f} ms per frame (p99 {result['p99_ms']:.3f} ms over {result['frames']} frames), "
            f"{result['pairs']} colliding pairs"
        )
    return ExitCode.DONE
