"""Measure what alerts cost in a step, and how wrong the distance at the closest approach is.

python benchmarks/alerts.py
"""

from __future__ import annotations

import statistics
import time

import numpy as np

import collision_monitor as cm
from collision_monitor.alerts.closest_approach import closest_approaches
from collision_monitor.alerts.monitored_bodies import MonitoredBodies
from collision_monitor.alerts.rules import Rules
from collision_monitor.codec import encode_descriptions, encode_states
from collision_monitor.monitor.nearest_points import nearest_points_at
from collision_monitor.objects.description import ObjectDescription
from collision_monitor.pipeline.pipeline import Pipeline
from collision_monitor.records import STATE

RULES = {
    "none": "",
    "answers": "caution: {time_to_collision: 2}, critical: {time_to_collision: 0.5}",
    "distance": "caution: {distance: 1}, critical: {distance: 0.2}",
    "traffic": "caution: {required_deceleration: 3, time_headway: 1, post_encroachment_time: 1}",
    "closest approach": "caution: {distance_at_closest_approach: 0.3, time_to_closest_approach: 1}",
}
STEPS = 60


def pipeline(levels: str, count: int) -> Pipeline:
    """A pipeline with one rule between carts and persons, half of the objects each."""
    text = f'classes: {{c: ["c*"], p: ["p*"]}}\nrules: {{near: {{between: [c, p], {levels}}}}}' if levels else ""
    made = Pipeline(rules=Rules.parse(text))
    shapes = [cm.Box((2.0, 1.0, 1.5)), cm.Cylinder(0.25, 1.75)]
    objects = [ObjectDescription(k, shapes[k % 2], name=f"{'cp'[k % 2]}{k}") for k in range(count)]
    made.on_shapes(encode_descriptions(0, "world", objects))
    return made


def costs(count: int) -> None:
    """Print the median and the 99th percentile of a step for each rule, all in turns."""
    generator = np.random.default_rng(0)
    side = 3.0 * count**0.5
    states = np.zeros(count, STATE)
    states["id"], states["quaternion"][:, 3] = np.arange(count), 1.0
    states["position"][:, :2] = generator.uniform(0, side, (count, 2))
    states["linear"][:, :2] = generator.normal(0, 1, (count, 2))
    pipelines = {name: pipeline(levels, count) for name, levels in RULES.items()}
    taken: dict[str, list[float]] = {name: [] for name in RULES}
    alerts = dict.fromkeys(RULES, 0)
    for step in range(STEPS):
        states["position"] += 0.05 * states["linear"]
        data = encode_states(step * 50_000_000, "world", step, states)
        for name, each in pipelines.items():
            begin = time.perf_counter()
            outputs = each.on_states(data)
            taken[name].append(time.perf_counter() - begin)
            alerts[name] += len(outputs.alerts) if outputs is not None else 0
    for name, times in taken.items():
        times = sorted(times[5:])
        print(
            f"| {count} | {name} | {1e3 * statistics.median(times):.2f} | {1e3 * times[int(0.99 * len(times))]:.2f} "
            f"| {alerts[name]} |"
        )


def errors(pairs: int = 2000) -> None:
    """Print how far the bound of DCPA is below the least of 2,001 distances, in parts of the relative path."""
    generator = np.random.default_rng(1)
    monitor = cm.Monitor()
    shapes = [cm.Box((2.0, 1.0, 1.5)), cm.Cylinder(0.25, 1.75), cm.Sphere(0.5), cm.Capsule(0.3, 1.0)]
    for k in range(100):
        monitor.add(k, shapes[k % 4])
    poses = np.hstack([generator.uniform(-6, 6, (100, 3)), generator.normal(size=(100, 4))])
    poses[:, 3:] /= np.linalg.norm(poses[:, 3:], axis=1)[:, None]
    twists = np.hstack([generator.normal(0, 2, (100, 3)), generator.normal(0, 1, (100, 3))])
    monitor.step(0, np.arange(100), poses, twists)
    scene = MonitoredBodies(monitor.roster, monitor.profile, monitor.now)
    i, j = generator.integers(0, 50, pairs).astype(np.int32), generator.integers(50, 100, pairs).astype(np.int32)
    begin = time.perf_counter()
    _, least = closest_approaches(scene, i, j, 2.0)
    each = (time.perf_counter() - begin) / pairs
    times = np.linspace(0.0, 2.0, 2001)
    worst = []
    for k in range(pairs):
        many = np.full(len(times), i[k]), np.full(len(times), j[k])
        found = nearest_points_at(
            scene.roster.multibody, *many, scene.now + times, np.full(len(times), np.inf), 0.0, scene.scratch
        )
        relative = np.sqrt(((scene.velocity[j[k]] - scene.velocity[i[k]]) ** 2).sum())
        path = 2.0 * (relative + scene.turning[i[k]] + scene.turning[j[k]])
        worst.append((found.distance.min() - least[k]) / path if found.distance.min() > 0.0 else 0.0)
    is_bound = min(worst) >= -1e-9
    print(
        f"\nDCPA of {pairs} pairs: {1e6 * each:.0f} µs each; below the least distance by "
        f"{100 * np.median(worst):.2f} % of the relative path (median), {100 * max(worst):.2f} % (most); {is_bound}"
    )


def main() -> None:
    """Print both."""
    print("| objects | rule | step, median (ms) | p99 (ms) | alerts |\n|---|---|---|---|---|")
    for count in (20, 200, 1000):
        costs(count)
    errors()


if __name__ == "__main__":
    main()
