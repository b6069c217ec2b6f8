"""`collision-monitor bench`: how long full detection takes, every pose new in each frame."""

from __future__ import annotations

import argparse
import json
import time
from pathlib import Path
from typing import Any, Final

from collision_monitor._version import VERSION
from collision_monitor.cli.quantities import whole

WARM_UP: Final = 2
"""Frames at the start that are not counted."""
CHECKED: Final = 4
"""The frame whose number of pairs is told; the one that other systems' answers are compared at."""

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
    parser.add_argument("--frames", type=whole(1), metavar="F", help=f"frames, {WARM_UP} uncounted (default: 12)")
    parser.add_argument("--threads", type=whole(1), metavar="T", help="default: 2, or 1 where there is one core")
    parser.add_argument("--json", action="store_true", help="print one line of JSON")
    parser.set_defaults(command=bench)


def bench(args: argparse.Namespace) -> int:
    """Run the benchmark. Raises InputError."""
    from collision_monitor.detection.detector import default_threads
    from collision_monitor.world.moving_bodies import FRAMES, load_bodies, make_bodies

    if args.scene_file is None:
        scene = make_bodies(args.scene, args.n, args.seed, args.frames or FRAMES)
    else:
        scene = load_bodies(args.scene_file)
    result = measure(scene, default_threads() if args.threads is None else args.threads, args.frames)
    if args.json:
        print(json.dumps(result))
    else:
        print(
            f"{result['scene']}, {result['n']} objects, {result['threads']} thread{'s'[: result['threads'] > 1]}: "
            f"{result['median_ms']:.3f} ms per frame (p99 {result['p99_ms']:.3f} ms over {result['frames']} frames), "
            f"{result['pairs']} colliding pairs"
        )
    return 0


def measure(scene: Any, threads: int, frames: int | None = None) -> dict[str, Any]:
    """Median and 99th percentile (ms) of a frame of a MovingBodies scene, and what was measured."""
    import numpy as np

    from collision_monitor.detection.detector import Detector

    detector = Detector(scene.shapes, threads=threads)
    detector.detect(scene.positions[0], scene.quaternions[0])  # compiles, where nothing is cached
    count = min(frames or len(scene.positions), len(scene.positions))
    warm_up = min(WARM_UP, count - 1)
    milliseconds, pairs = [], 0
    for frame in range(count):
        begin = time.perf_counter_ns()
        contacts = detector.detect(scene.positions[frame], scene.quaternions[frame])
        _ = contacts.pairs, contacts.signed_distance, contacts.normal, contacts.point
        milliseconds.append((time.perf_counter_ns() - begin) / 1e6)
        if frame <= CHECKED:
            pairs = len(contacts)
    counted = np.array(milliseconds[warm_up:])
    return {
        "scene": scene.name,
        "n": len(scene.shapes),
        "seed": scene.seed,
        "threads": threads,
        "frames": len(counted),
        "median_ms": float(np.median(counted)),
        "p99_ms": float(np.percentile(counted, 99)),
        "min_ms": float(counted.min()),
        "pairs": pairs,
        "version": VERSION,
    }
