"""Measure steps with a budget of a third of their usual time: how many end in time, and the answers for deferred pairs.

    python benchmarks/overload.py                      # 1,500 bodies that all change their course in every step
    python benchmarks/overload.py --overload 10 --steps 20000
    python benchmarks/overload.py --objects 300 --shapes links --no-trees

The benchmark first measures the median step without a budget, then runs --steps steps with 1/--overload of that time.
At every --every th step recomputation gives the truth. The benchmark counts collisions that are neither contacts nor
predicted (must be 0), intervals that do not hold (must be 0), and UNRESOLVED answers.
Between the steps it times the same walk through 4 MB of memory, which shows how often the machine alone is late.
"""

from __future__ import annotations

import argparse
import gc
import json
import os
import sys
import time
from typing import Any

import numpy as np
from event_list import RATE, Boxes
from numpy.typing import NDArray

from collision_monitor import Box, ConvexHull, Monitor, StepResult, records
from collision_monitor.accuracy.reference_monitor import ReferenceMonitor
from collision_monitor.impact import sphere_trees
from collision_monitor.settings.profile import Profile
from collision_monitor.world.arm import link

WARM = 50
WALKED = np.arange(500_000) * 40_503 % 500_000
"""Indices of the walk; no two consecutive ones are adjacent."""


def machine_alone(memory: NDArray[np.float64]) -> float:
    """Time (s) of constant work that takes about as long as the part of a step that no budget cuts."""
    began = time.perf_counter()
    for part in range(20):
        memory.take(WALKED[part * 10_000 : (part + 1) * 10_000]).sum()
    return time.perf_counter() - began


def by_pair(rows: NDArray[np.void]) -> dict[tuple[int, int], Any]:
    """Rows by their pair of ids."""
    return {(int(row["id_a"]), int(row["id_b"])): row for row in rows}


def wrong(mine: StepResult, truth: StepResult, horizon: float) -> tuple[int, int]:
    """Number of collisions without an answer, and number of answers that do not hold."""
    reported, touching = (by_pair(r.contacts[r.contacts["phase"] != records.Phase.END]) for r in (mine, truth))
    stated, true = by_pair(mine.predictions), by_pair(truth.predictions)
    certain = {k for k, e in true.items() if e["status"] == records.PredictionStatus.HIT and e["upper"] < horizon}
    missed = (touching.keys() | certain) - reported.keys() - stated.keys()
    off = [k for k in reported.keys() & touching.keys() if _is_off(reported[k], touching[k])]
    off += [k for k in stated.keys() & true.keys() if _is_apart(stated[k], true[k])]
    return len(missed), len(off)


def _is_off(contact: Any, truth: Any) -> bool:
    return bool(abs(contact["signed_distance"] - truth["signed_distance"]) > contact["error_bound"] + 1e-9)


def _is_apart(prediction: Any, truth: Any) -> bool:
    return bool(prediction["lower"] > truth["upper"] or prediction["upper"] < truth["lower"])


def describe(monitor: Monitor, boxes: Boxes, shape: str) -> None:
    """Describe half of the bodies as boxes and half as convex hulls of 32 corners, or all as long hulls ("links")."""
    rng = np.random.default_rng(7)
    for i, size in enumerate(boxes.size):
        if shape == "links":
            monitor.add(i, ConvexHull(link(float(size.max()), 0.12 * float(size.max())).vertices))
            continue
        corners = rng.normal(size=(32, 3))
        corners *= size / 2 / np.linalg.norm(corners, axis=1, keepdims=True)
        monitor.add(i, ConvexHull(corners) if i % 2 else Box(size))


def run(args: argparse.Namespace) -> dict[str, Any]:
    """Measure; returns the row of results."""
    boxes = Boxes(args.objects, args.seed)
    free, plain = Monitor(), ReferenceMonitor()
    for monitor in (free, plain):
        describe(monitor, boxes, args.shapes)
    full = []
    for step in range(2 * WARM):
        states = boxes.states(0.0)
        began = time.perf_counter()
        free.step(round(step * 1e9 / RATE), states)
        full.append(time.perf_counter() - began)
        boxes.move(1 / RATE, args.turning)
        boxes.walls()
    full_ms = 1e3 * float(np.median(full[WARM:]))
    budget = full_ms / args.overload if args.budget_ms is None else args.budget_ms
    if args.no_trees:
        sphere_trees.MOST_CORNERS = 0  # type: ignore[misc]
    monitor = Monitor(Profile(budget_ms=budget))
    describe(monitor, boxes, args.shapes)
    gc.collect()
    gc.freeze()
    spent, alone = np.empty((2, args.steps))
    deferred = missed = off = unresolved = reported = 0
    memory = np.ones(len(WALKED))
    for step in range(-WARM, args.steps):
        time.sleep(args.pause_ms * 1e-3)
        walked = 1e3 * machine_alone(memory)
        time.sleep(args.pause_ms * 1e-3)
        states, stamp = boxes.states(0.0), round((step + 3 * WARM) * 1e9 / RATE)
        began = time.perf_counter()
        answer = monitor.step(stamp, states)
        took = 1e3 * (time.perf_counter() - began)
        if step >= 0:
            spent[step], alone[step] = took, walked
            deferred += answer.status.deferred
            if step % args.every == 0:
                one, two = wrong(answer, plain.step(stamp, states), monitor.profile.horizon)
                missed, off = missed + one, off + two
                reported += answer.status.contacts + answer.status.predictions
                unresolved += answer.status.unresolved
        boxes.move(1 / RATE, args.turning)
        boxes.walls()
    compared = -(-args.steps // args.every)
    spent = np.delete(spent, np.arange(1, args.steps, args.every))  # they ran with caches full of the comparison
    return {
        "objects": args.objects,
        "full_ms": full_ms,
        "budget_ms": budget,
        "steps": args.steps,
        "median_ms": float(np.median(spent)),
        "p99_9_ms": float(np.percentile(spent, 99.9)),
        "worst_ms": float(spent.max()),
        "in_time": float((spent <= 1.1 * budget).mean()),
        "machine_alone_ms": float(np.median(alone)),
        "machine_alone_p99_9_ms": float(np.percentile(alone, 99.9)),
        "machine_alone_in_time": float((alone <= 1.1 * np.median(alone)).mean()),
        "deferred_per_step": deferred / args.steps,
        "reported_per_step": reported / compared,
        "unresolved_per_step": unresolved / compared,
        "compared_steps": compared,
        "missed": missed,
        "bounds_that_do_not_hold": off,
        "load": os.getloadavg()[0],
    }


def main() -> int:
    """Return exit code 3 if a collision is missed or a bound does not hold."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--objects", type=int, default=1500)
    parser.add_argument("--shapes", choices=("mixed", "links"), default="mixed", help="boxes and hulls, or long hulls")
    parser.add_argument("--no-trees", action="store_true", help="without sphere trees, for comparison")
    parser.add_argument("--steps", type=int, default=5000)
    parser.add_argument("--overload", type=float, default=3.0, help="ratio of the median full step to the budget")
    parser.add_argument("--budget-ms", type=float, help="budget (ms), in place of --overload")
    parser.add_argument("--turning", type=float, default=1.0, help="part of the boxes that change course in a step")
    parser.add_argument("--every", type=int, default=100, help="compare with recomputation at every K-th step")
    parser.add_argument("--pause-ms", type=float, default=2.0, help="pause between steps (ms), as on a robot")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--json", action="store_true", help="print one JSON line")
    args = parser.parse_args()
    row = run(args)
    if args.json:
        print(json.dumps(row))
    else:
        for name, value in row.items():
            print(f"{name:24} {value:.4f}" if isinstance(value, float) else f"{name:24} {value}")
    return 3 if row["missed"] or row["bounds_that_do_not_hold"] else 0


if __name__ == "__main__":
    sys.exit(main())
