"""Compare `time_of_impact_batch` with fine samples, for random shapes and motions: no impact missed, none late.

Prints a Markdown table and ends with exit code 1 if an answer is wrong. No sample before the stated lower end may find
two shapes that overlap by more than round-off, and at the stated upper end they must touch. The samples are 1/997 s
apart. A sample is skipped only if the signed distance at an earlier sample is larger than the distance that the two can
have closed since then, at their relative speed and their angular speeds times their radii.

    python benchmarks/impact_oracle.py                  10,000 for each pair of kinds: under a minute
    python benchmarks/impact_oracle.py --motions 1000000 --progress oracle.json

With --progress the results are kept in a file and an interrupted run continues; runs with other seeds add to it.
"""

from __future__ import annotations

import argparse
import json
import math
import sys
from collections.abc import Callable
from itertools import combinations_with_replacement
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

import collision_monitor as cm
from collision_monitor._jit import kernel
from collision_monitor.impact.body_impact import ShapePair, contact_at
from collision_monitor.motion.motion import relative_position
from collision_monitor.query.impact.impact_kernel import MEMORY, set_pair
from collision_monitor.query.impact.impact_methods import moving_shapes

Array = NDArray[np.float64]
Shape = cm.Sphere | cm.Box | cm.Capsule | cm.Cylinder | cm.Cone | cm.ConvexHull | cm.HalfSpace
HORIZON = 2.0
STEP = 1 / 997
BATCH = 2000
ROUND = 5
"""Batches of one pair of kinds before the next, so that an interrupted run has equally many of each."""
ROUND_OFF = 1e-8
COUNTS = ("hits", "unresolved", "missed or late", "not touching at the upper end")

KINDS: dict[str, Callable[[np.random.Generator], Shape]] = {
    "sphere": lambda rng: cm.Sphere(rng.uniform(0.1, 0.6)),
    "box": lambda rng: cm.Box(rng.uniform(0.05, 1.2, 3)),
    "plate": lambda rng: cm.Box((1.0, 1.0, 1e-3)),
    "capsule": lambda rng: cm.Capsule(rng.uniform(0.05, 0.4), rng.uniform(0.2, 1.5)),
    "cylinder": lambda rng: cm.Cylinder(rng.uniform(0.05, 0.4), rng.uniform(0.05, 1.0)),
    "cone": lambda rng: cm.Cone(rng.uniform(0.1, 0.4), rng.uniform(0.2, 1.0)),
    "hull": lambda rng: cm.ConvexHull(rng.normal(0, 0.3, (12, 3))),
    "half-space": lambda rng: cm.HalfSpace(rng.normal(0, 1, 3), rng.uniform(-2, -1)),
}
PAIRS = [pair for pair in combinations_with_replacement(KINDS, 2) if pair != ("half-space", "half-space")]


def states(rng: np.random.Generator, shape: Shape) -> Array:
    """Motions (N, 13) as pose and twist; half of them are fast, separately in speed and in angular speed."""
    q = rng.normal(size=(BATCH, 4))
    q /= np.linalg.norm(q, axis=1, keepdims=True)
    fast = rng.choice([1.0, 5.0], (BATCH, 2))
    linear, angular = rng.normal(size=(BATCH, 3)) * fast[:, :1], rng.normal(size=(BATCH, 3)) * fast[:, 1:]
    if isinstance(shape, cm.HalfSpace):
        angular[:] = 0.0
    return np.column_stack([rng.uniform(-1.3, 1.3, (BATCH, 3)), q, linear, angular])


@kernel
def overlaps_before(moving: Any, step: float, until: Any, deep: float, scratch: Any, found: Any) -> None:
    """Write the first sample (s) before `until` (N,) at which each pair is deeper than `deep` (m) into found (N,).

    Infinite if there is none.
    """
    (table, parts), motion, chains, motions_a, motions_b = moving
    A, B = motion[0], motion[1]
    pair = ShapePair(A, B, chains[0], chains[1])
    for k in range(len(found)):
        set_pair(table, parts, chains, motion, motions_a, k, motions_b, k)
        speed = math.sqrt((B.vx - A.vx) ** 2 + (B.vy - A.vy) ** 2 + (B.vz - A.vz) ** 2)
        for m in (A, B):
            turning = math.sqrt(m.wx**2 + m.wy**2 + m.wz**2)
            if turning > 0.0:
                speed += turning * m.radius
        found[k] = math.inf
        n = 0
        while n * step < until[k]:
            t = n * step
            px, py, pz = relative_position(A, B, t)
            gap = math.sqrt(px * px + py * py + pz * pz) - A.radius - B.radius
            if not gap > 0.0:
                gap = contact_at(table, parts, pair, t, scratch)
                if gap < -deep:
                    found[k] = t
                    break
                gap -= scratch.out[10]
            n = max(n + 1, math.ceil((t + 0.999 * gap / speed) / step))


@kernel
def distances(moving: Any, times: Any, scratch: Any, found: Any) -> None:
    """Write the signed distances (m) of the pairs at `times` (N,) into found (N,), one time for each pair."""
    (table, parts), motion, chains, motions_a, motions_b = moving
    pair = ShapePair(motion[0], motion[1], chains[0], chains[1])
    for k in range(len(found)):
        set_pair(table, parts, chains, motion, motions_a, k, motions_b, k)
        found[k] = contact_at(table, parts, pair, times[k], scratch)


def check(rng: np.random.Generator, kind_a: str, kind_b: str) -> NDArray[np.int_]:
    """Counts of one batch, in the order of COUNTS."""
    a_shape, b_shape = KINDS[kind_a](rng), KINDS[kind_b](rng)
    a, b = states(rng, a_shape), states(rng, b_shape)
    answers = cm.time_of_impact_batch(a_shape, a[:, :7], a[:, 7:], b_shape, b[:, :7], b[:, 7:], HORIZON)
    moving = moving_shapes(a_shape, a, b_shape, b)
    first, apart, scratch = np.empty(BATCH), np.empty(BATCH), MEMORY.scratch
    overlaps_before(moving, STEP, np.minimum(answers.lower, HORIZON + STEP), ROUND_OFF, scratch, first)
    hit = answers.status == "hit"
    distances(moving, np.where(hit, answers.upper, 0.0), scratch, apart)
    return np.array(
        [
            hit.sum(),
            (answers.status == "unresolved").sum(),
            np.isfinite(first).sum(),
            (hit & ~(apart <= ROUND_OFF)).sum(),
        ]
    )


class Progress:
    """Number of motions and COUNTS for each pair of kinds and seed, kept in a file if a path is given."""

    def __init__(self, path: Path | None) -> None:
        self.path = path
        self.rows: dict[str, list[int]] = json.loads(path.read_text()) if path and path.exists() else {}

    def row(self, pair: tuple[str, str], seed: int) -> list[int]:
        """Number of motions so far and their COUNTS."""
        return self.rows.setdefault(f"{', '.join(pair)}; seed {seed}", [0] * (1 + len(COUNTS)))

    def add(self, pair: tuple[str, str], seed: int, counts: NDArray[np.int_]) -> None:
        """Add the counts of one batch."""
        row = self.row(pair, seed)
        row[:] = [row[0] + BATCH, *(int(old + new) for old, new in zip(row[1:], counts, strict=True))]

    def save(self) -> None:
        """Write the file atomically."""
        if self.path:
            part = self.path.with_suffix(".part")
            part.write_text(json.dumps(self.rows, indent=0))
            part.replace(self.path)

    def table(self) -> NDArray[np.int_]:
        """Sums over the seeds, a row for each of PAIRS: number of motions and COUNTS."""
        return np.array(
            [
                np.sum([row for name, row in self.rows.items() if name.startswith(f"{', '.join(pair)};")], axis=0)
                for pair in PAIRS
            ]
        )


def main() -> int:
    """Measure and print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--motions", type=int, default=10_000, help="random motions for each pair of kinds")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--progress", type=Path, help="file that keeps the results")
    arguments = parser.parse_args()
    progress, seed = Progress(arguments.progress), arguments.seed
    batches = -(-arguments.motions // BATCH)
    for until in range(ROUND, batches + ROUND, ROUND):
        for index, pair in enumerate(PAIRS):
            done = progress.row(pair, seed)[0] // BATCH
            for batch in range(done, min(until, batches)):
                progress.add(pair, seed, check(np.random.default_rng([seed, index, batch]), *pair))
        progress.save()
    table = progress.table()
    print("| pair | motions | " + " | ".join(COUNTS) + " |")
    print("|---|" + "---:|" * (1 + len(COUNTS)))
    for name, row in zip([*map(", ".join, PAIRS), "all"], [*table, table.sum(0)], strict=True):
        print(f"| {name} | " + " | ".join(map(str, row)) + " |")
    return 1 if table[:, 3:].any() else 0


if __name__ == "__main__":
    sys.exit(main())
