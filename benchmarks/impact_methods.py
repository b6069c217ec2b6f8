"""Compare all methods for the time of impact on the same pairs: µs per pair, misses, false alarms, worst error.

Prints a Markdown table for each set of pairs; `--pairs 1000` is quicker.
The truth is the lower end of conservative advancement at a tolerance of 1e-12 m, which the tests compare with dense
samples and exact roots. Pairs that pass each other within that tolerance are ignored.

    python benchmarks/impact_methods.py
"""

from __future__ import annotations

import argparse
import time
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

import collision_monitor as cm
from collision_monitor.errors import UnsupportedError
from collision_monitor.query.impact.impact_methods import METHODS, bisection, conservative_advancement, end_of_step

Array = NDArray[np.float64]
HORIZON = 2.0
RUNS = 3

CALLS: dict[str, Any] = {
    "closed form": METHODS["closed_form"],
    "swept volume bound": METHODS["swept_bounds"],
    "swept SAT": METHODS["swept_sat"],
    "conservative advancement, 1e-4 m": partial(conservative_advancement, tolerance=1e-4),
    "conservative advancement, 1e-6 m": partial(conservative_advancement, tolerance=1e-6),
    "bisection, steps of 1/60 s": bisection,
    "bisection, steps of 1/1000 s": partial(bisection, step=1e-3),
    "end of the step, 1/60 s": end_of_step,
}


def states(rng: np.random.Generator, count: int, spread: float, spin: float) -> Array:
    """Motions (N, 13) in a cube, as pose and twist; twice `spread` is the side of the cube (m), `spin` in rad/s."""
    q = rng.normal(size=(count, 4))
    q /= np.linalg.norm(q, axis=1, keepdims=True)
    position, linear = rng.uniform(-spread, spread, (count, 3)), rng.normal(size=(count, 3))
    return np.column_stack([position, q, linear, spin * rng.normal(size=(count, 3))])


def towards(rng: np.random.Generator, count: int, speed: float, spin: float) -> tuple[Array, Array]:
    """Motions in which B comes from 3 m to 5 m away and passes near A, which turns."""
    a, b = states(rng, count, 0.0, spin), states(rng, count, 0.0, spin)
    a[:, 7:10] = 0.0
    way = rng.normal(size=(count, 3))
    way /= np.linalg.norm(way, axis=1, keepdims=True)
    b[:, 7:10] = speed * way
    b[:, :3] = -way * rng.uniform(3, 5, (count, 1)) + rng.normal(0, 0.5, (count, 3))
    return a, b


def at_each_other(rng: np.random.Generator, count: int) -> tuple[Array, Array]:
    """Motions in which B starts 2 m to 6 m from A and passes it within about half a metre after 1 s to 2.5 s.

    Both turn slowly.
    """
    a, b = states(rng, count, 0.0, 0.0), states(rng, count, 0.0, 0.0)
    way = rng.normal(size=(count, 3))
    way *= rng.uniform(2, 6, (count, 1)) / np.linalg.norm(way, axis=1, keepdims=True)
    a[:, 7:10] = rng.uniform(-0.5, 0.5, (count, 3))
    b[:, :3] = way
    b[:, 7:10] = a[:, 7:10] + (rng.normal(0, 0.45, (count, 3)) - way) / rng.uniform(1, 2.5, (count, 1))
    for state in (a, b):
        state[:, 10:] = rng.uniform(-1, 1, (count, 3))
    return a, b


Scene = tuple[cm.Sphere | cm.Box, Array, cm.Sphere | cm.Box, Array]


def scenes(rng: np.random.Generator, count: int) -> dict[str, Scene]:
    """Two shapes and their motions, by the difficulty of the scene."""
    box, slab, rod, ball = cm.Box((0.7, 0.9, 0.5)), cm.Box((1.2, 0.3, 0.8)), cm.Box((2, 0.02, 0.02)), cm.Sphere(0.05)
    plate, bullet = cm.Box((1, 1, 1e-3)), cm.Sphere(5e-4)
    return {
        "spheres": (cm.Sphere(0.5), *_each(towards(rng, count, 2.0, 0.0), cm.Sphere(0.3))),
        "boxes that do not turn": (box, *_each(towards(rng, count, 2.0, 0.0), slab)),
        "boxes that fly at each other": (box, *_each(at_each_other(rng, count), slab)),
        "boxes that turn at 2 rad/s": (box, *_each(towards(rng, count, 2.0, 2.0), slab)),
        "rods that turn at 20 rad/s, and a ball": (rod, *_each(towards(rng, count, 2.0, 20.0), ball)),
        "a plate of 1 mm and a bullet at 1000 m/s": (plate, *_each(towards(rng, count, 1e3, 0.0), bullet)),
    }


def _each(motions: tuple[Array, Array], shape: cm.Sphere | cm.Box) -> tuple[Array, cm.Sphere | cm.Box, Array]:
    return motions[0], shape, motions[1]


def truth(a_shape: Any, a: Array, b_shape: Any, b: Array) -> tuple[Array, NDArray[np.bool_]]:
    """Times of impact (N,), and whether each pair (N,) is certain, that is, not too close to a graze."""
    poses_a, twists_a, poses_b, twists_b = a[:, :7], a[:, 7:], b[:, :7], b[:, 7:]
    answers = cm.time_of_impact_batch(a_shape, poses_a, twists_a, b_shape, poses_b, twists_b, HORIZON, 1e-12)
    certain = answers.status != "unresolved"
    return answers.lower, certain


def measure(call: Any, scene: Scene, exact: Array, certain: NDArray[np.bool_]) -> str:
    """One row of the table, with the fastest of a few runs."""
    best = np.inf
    for _ in range(RUNS):
        start = time.process_time()
        found = call(*scene, HORIZON)
        best = min(best, time.process_time() - start)
    met, answered = np.isfinite(exact), np.isfinite(found)
    both = met & answered & certain
    error = found[both] - exact[both]
    late, early = float(error.max(initial=0.0)), abs(float(error.min(initial=0.0)))
    missed, alarms = int((met & ~answered & certain).sum()), int((~met & answered & certain).sum())
    return f"{1e6 * best / len(exact):.2f} | {missed} | {alarms} | {late:.1e} | {early:.1e}"


def main() -> None:
    """Measure and print the tables."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--pairs", type=int, default=5000)
    count = parser.parse_args().pairs
    for name, scene in scenes(np.random.default_rng(1), count).items():
        exact, certain = truth(*scene)
        hits = int(np.isfinite(exact).sum())
        print(f"\n{name}: {count} pairs, {hits} meet within {HORIZON:g} s, {int((~certain).sum())} too near to tell\n")
        print("| method | µs a pair | missed | false alarms | late by at most (s) | early by at most (s) |")
        print("|---|---:|---:|---:|---:|---:|")
        for method, call in CALLS.items():
            try:
                call(
                    *(part[:1] if isinstance(part, np.ndarray) else part for part in scene), HORIZON
                )  # compiles the kernels
                print(f"| {method} | {measure(call, scene, exact, certain)} |")
            except UnsupportedError:
                continue


if __name__ == "__main__":
    main()
