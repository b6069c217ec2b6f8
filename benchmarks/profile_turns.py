"""Time of a step of each profile relative to `exact`: all profiles answer the same states in turn.

    python benchmarks/profile_turns.py                              # 100, 1,000 and 10,000 objects of each scene
    python benchmarks/profile_turns.py --sizes 100 --noise 0.005    # states that declare a noise
    python benchmarks/profile_turns.py --scenes mixed --kinds cone  # every second object a cone, the others meshes

    python benchmarks/profile_turns.py --scenes meshes --alone      # one profile at a time, as in a node

The median over the steps of the ratio of both times, and half of the width of its 95 % interval by the order of the
ratios. The order of the profiles changes from step to step. The garbage collector is off. In turns, each monitor finds
the caches full of the others' data; with --alone, each profile answers the whole scene, three times in turn, and the
shortest time of each step counts.
"""

from __future__ import annotations

import argparse
import gc
import math
import time
from collections.abc import Sequence

import numpy as np
from drifting_meshes import SOLIDS, drifting_meshes

from collision_monitor.accuracy.inputs import Workload, simulated
from collision_monitor.monitor.monitor import Monitor

PROFILES = ("fast", "balanced", "exact")
MESHES = "meshes"
"""Scene of benchmarks/drifting_meshes.py."""
MIXED = "mixed"
"""The same with a solid in place of every second mesh."""
SCENES = ("fleet", "clutter", "swarm", "particles", "crossing", "arm", MESHES, MIXED)
FIXED = ("crossing", "arm")
"""Scenes with a fixed set of objects."""


def times(work: Workload, names: Sequence[str] = PROFILES) -> np.ndarray:
    """Time (ms) of each step but the first two, of each profile (P, n)."""
    monitors = [Monitor(name, warns=False) for name in names]
    for monitor in monitors:
        for description in work.descriptions:
            monitor.describe(description)
    taken = np.empty((len(names), len(work.steps)))
    gc.collect()
    gc.disable()
    for k, (stamp, states) in enumerate(work.steps):
        for turn in np.random.default_rng(k).permutation(len(names)):
            begin = time.perf_counter()
            monitors[turn].step(stamp, states)
            taken[turn, k] = 1e3 * (time.perf_counter() - begin)
    gc.enable()
    return taken[:, 2:]


def times_alone(work: Workload) -> np.ndarray:
    """As `times`, but one profile at a time: the shortest of three runs."""
    runs = [[times(work, [name])[0] for name in PROFILES] for _ in range(3)]
    return np.min(runs, axis=0)


def median_ratio(a: np.ndarray, b: np.ndarray) -> tuple[float, float]:
    """Median of a / b and half of the width of its 95 % interval."""
    ratios = np.sort(a / b)
    n = len(ratios)
    off = 0.98 * math.sqrt(n)
    low, high = ratios[max(int(n / 2 - off), 0)], ratios[min(math.ceil(n / 2 + off), n - 1)]
    return float(np.median(ratios)), float(0.5 * (high - low))


def main() -> None:
    """Print a row of Markdown for each scene and size."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--sizes", type=int, nargs="+", default=[100, 1_000, 10_000])
    parser.add_argument("--scenes", nargs="+", default=list(SCENES))
    parser.add_argument("--kinds", nargs="+", default=list(SOLIDS), choices=list(SOLIDS), help="solids of `mixed`")
    parser.add_argument("--noise", type=float, default=0.0)
    parser.add_argument("--seconds", type=float, default=4.0)
    parser.add_argument("--alone", action="store_true", help="run one profile at a time")
    args = parser.parse_args()
    print("| scene | objects | exact, ms | fast : exact | balanced : exact |\n|---|---|---|---|---|")
    for name in args.scenes:
        for size in [None] if name in FIXED else args.sizes:
            seconds = args.seconds if size is None or size < 5_000 else 0.5 * args.seconds
            if name in (MESHES, MIXED):
                work = drifting_meshes(size or 0, seconds, kinds=args.kinds if name == MIXED else ())
            else:
                (work,) = simulated([name], objects=size, noise=args.noise, duration=seconds)
            fast, balanced, exact = times_alone(work) if args.alone else times(work)
            ratios = [median_ratio(each, exact) for each in (fast, balanced)]
            cells = " | ".join(f"{ratio:.3f} ± {off:.3f}" for ratio, off in ratios)
            print(f"| {name} | {len(work.descriptions):,} | {np.median(exact):.3g} | {cells} |", flush=True)


if __name__ == "__main__":
    main()
