"""No impact missed, none late: `time_of_impact_batch` against fine samples, random shapes and motions of every kind.

Prints a Markdown table and ends with 1 where an answer was wrong. A sample at which two shapes overlap by more than
round-off has to lie behind the stated lower end; by the stated upper end they have to touch.

    python benchmarks/impact_oracle.py                  10,000 for each pair of kinds: about two minutes
    python benchmarks/impact_oracle.py --pairs 1000000
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable
from itertools import combinations_with_replacement

import numpy as np
from numpy.typing import NDArray

import collision_monitor as cm
from collision_monitor.geometry.pose import from_rotation_vector, multiply, rotation_matrix
from collision_monitor.geometry.shape_table import ShapeTableBuilder, take
from collision_monitor.narrow_phase.dispatch import contact_batch
from collision_monitor.prediction.impact_methods import end_of_step

Array = NDArray[np.float64]
Shape = cm.Sphere | cm.Box | cm.Capsule | cm.Cylinder | cm.Cone | cm.ConvexHull | cm.HalfSpace
HORIZON = 2.0
STEP = 1 / 97
BATCH = 2000
ROUND_OFF = 1e-8

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


def states(rng: np.random.Generator, shape: Shape) -> Array:
    """Motions (N, 13): half of them slow, half fast, in speed and in turning."""
    q = rng.normal(size=(BATCH, 4))
    q /= np.linalg.norm(q, axis=1, keepdims=True)
    fast = rng.choice([1.0, 5.0], (BATCH, 2))
    linear, angular = rng.normal(size=(BATCH, 3)) * fast[:, :1], rng.normal(size=(BATCH, 3)) * fast[:, 1:]
    if isinstance(shape, cm.HalfSpace):
        angular[:] = 0.0
    return np.column_stack([rng.uniform(-1.3, 1.3, (BATCH, 3)), q, linear, angular])


def distances(a_shape: Shape, a: Array, b_shape: Shape, b: Array, times: Array) -> Array:
    """Signed distances (N,) at a time (N,) of its own for each row."""
    builder = ShapeTableBuilder()
    builder.append(a_shape)
    builder.append(b_shape)
    count = len(times)
    slots = np.repeat([0, 1], count)
    position, rotation = np.empty((2, count, 3)), np.empty((2, count, 3, 3))
    for k, state in enumerate((a, b)):
        position[k] = state[:, :3] + times[:, None] * state[:, 7:10]
        turn = from_rotation_vector(times[:, None] * state[:, 10:])
        rotation[k] = rotation_matrix(multiply(turn, state[:, 3:7]))
    pairs = np.arange(2 * count, dtype=np.int32).reshape(2, count).T.copy()
    rows = contact_batch(take(builder.table, slots), position.reshape(-1, 3), rotation.reshape(-1, 3, 3), pairs)
    return np.asarray(rows[:, 0])


def check(rng: np.random.Generator, kind_a: str, kind_b: str) -> NDArray[np.int_]:
    """Of one batch: hits, unresolved ones, missed or late ones, upper ends at which they do not touch."""
    a_shape, b_shape = KINDS[kind_a](rng), KINDS[kind_b](rng)
    a, b = states(rng, a_shape), states(rng, b_shape)
    answers = cm.time_of_impact_batch(a_shape, a[:, :7], a[:, 7:], b_shape, b[:, :7], b[:, 7:], HORIZON)
    sampled = end_of_step(a_shape, a, b_shape, b, HORIZON, STEP)
    late = np.flatnonzero(answers.lower > sampled)
    deep = distances(a_shape, a[late], b_shape, b[late], sampled[late]) < -ROUND_OFF
    hit = np.flatnonzero(answers.status == "hit")
    apart = distances(a_shape, a[hit], b_shape, b[hit], answers.upper[hit]) > ROUND_OFF
    return np.array([len(hit), (answers.status == "unresolved").sum(), deep.sum(), apart.sum()])


def main() -> int:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--pairs", type=int, default=10_000)
    parser.add_argument("--seed", type=int, default=1)
    arguments = parser.parse_args()
    batches = -(-arguments.pairs // BATCH)
    wrong = 0
    print("| pair | motions | hits | unresolved | missed or late | not touching at the upper end |")
    print("|---|---:|---:|---:|---:|---:|")
    for index, (kind_a, kind_b) in enumerate(combinations_with_replacement(KINDS, 2)):
        if kind_a == kind_b == "half-space":
            continue
        rng = np.random.default_rng([arguments.seed, index])
        counts = np.sum([check(rng, kind_a, kind_b) for _ in range(batches)], axis=0)
        wrong += int(counts[2:].sum())
        print(f"| {kind_a}, {kind_b} | {batches * BATCH} | " + " | ".join(map(str, counts)) + " |", flush=True)
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
