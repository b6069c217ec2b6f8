"""Plane instead of space: the same flat scene as circles and polygons, and as cylinders and boxes of 2 m height.

    python benchmarks/plane_and_space.py --objects 1000

Bodies drive in a square, turn about z, and change their course every 2 s in the mean. Both monitors answer the same
states in turn: ms per step (median), the ratio with half of its 95 % interval, and the largest differences of the
answers: the true ones are the same, so each differs by no more than the tolerances.
"""

from __future__ import annotations

import argparse
import gc
import math
import time

import numpy as np
from profile_turns import median_ratio

from collision_monitor.monitor.monitor import Monitor
from collision_monitor.records import STATE
from collision_monitor.shapes.registry import Box, Circle, Cylinder, Polygon, Shape

RATE, HEIGHT, TURNS = 20.0, 2.0, 0.5
Pair = tuple[int, int]


def bodies(k: int, flat: bool) -> Shape:
    """Shape of body k: half of them are round."""
    if k % 2:
        return Circle(0.3) if flat else Cylinder(0.3, HEIGHT)
    return Polygon([(-0.4, -0.25), (0.4, -0.25), (0.4, 0.25), (-0.4, 0.25)]) if flat else Box((0.8, 0.5, HEIGHT))


def steps(count: int, seconds: float) -> list[np.ndarray]:
    """States (records.STATE) of each step."""
    rng, half = np.random.default_rng(1), 1.2 * math.sqrt(count)
    states = np.zeros(count, STATE)
    states["id"] = np.arange(1, count + 1)
    states["position"][:, :2] = rng.uniform(-half, half, (count, 2))
    yaw, found, new = rng.uniform(-np.pi, np.pi, count), [], np.ones(count, bool)
    for _ in range(round(seconds * RATE)):
        states["linear"][new, :2] = rng.normal(0, 1.0, (new.sum(), 2))
        states["angular"][new, 2] = rng.normal(0, 0.5, new.sum())
        states["quaternion"][:, 2], states["quaternion"][:, 3] = np.sin(0.5 * yaw), np.cos(0.5 * yaw)
        found.append(states.copy())
        states["position"] += states["linear"] / RATE
        yaw += states["angular"][:, 2] / RATE
        states["linear"][(np.abs(states["position"]) > half) & (states["position"] * states["linear"] > 0)] *= -1.0
        new = rng.random(count) < TURNS / RATE
    return found


def rows(records: np.ndarray, name: str) -> dict[Pair, float]:
    """The number with this name of each pair."""
    return {(int(r["id_a"]), int(r["id_b"])): float(r[name]) for r in records}


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--objects", type=int, default=1000)
    parser.add_argument("--seconds", type=float, default=4.0)
    parser.add_argument("--profile", default="balanced")
    args = parser.parse_args()
    monitors = [Monitor(args.profile, warns=False) for _ in range(2)]
    for flat, monitor in zip((True, False), monitors, strict=True):
        for k in range(args.objects):
            monitor.add(k + 1, bodies(k, flat))
    taken: list[list[float]] = [[], []]
    apart = {"signed_distance": [0.0], "lower": [0.0]}
    lone = {"signed_distance": 0, "lower": 0}
    seen = dict(lone)
    gc.disable()
    for number, states in enumerate(steps(args.objects, args.seconds)):
        results = [None, None]
        for turn in (0, 1) if number % 2 else (1, 0):
            began = time.perf_counter()
            results[turn] = monitors[turn].step(round(number * 1e9 / RATE), states)
            taken[turn].append(1e3 * (time.perf_counter() - began))
        for name in apart:
            of = "contacts" if name == "signed_distance" else "predictions"
            a, b = (rows(getattr(each, of), name) for each in results)
            apart[name] += [abs(a[pair] - b[pair]) for pair in a.keys() & b.keys()]
            lone[name] += len(a.keys() ^ b.keys())
            seen[name] += len(b)
    plane, space = (np.array(each[2:]) for each in taken)
    ratio, off = median_ratio(plane, space)
    print(f"{args.objects} objects: plane {np.median(plane):.3g} ms, space {np.median(space):.3g} ms a step")
    print(f"plane : space {ratio:.3f} ± {off:.3f}")
    for name, values in apart.items():
        print(f"{name}: {seen[name]} in space, {lone[name]} only in one, largest difference {max(values):.3g}")


if __name__ == "__main__":
    main()
