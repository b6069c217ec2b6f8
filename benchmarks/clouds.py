"""What a cloud costs: its tree, the way from a message to the step, and a step of robots among its points.

    python benchmarks/clouds.py [--points 20000] [--robots 100]

Prints median and best times in ms. The parts of the way are measured in turns, because other programs use the cores.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable
from time import perf_counter

import numpy as np

import collision_monitor as cm
from collision_monitor.codec import encode_descriptions
from collision_monitor.meshes.trees.cloud_tree import cloud_tree
from collision_monitor.objects.description import ObjectDescription
from collision_monitor.pipeline.pipeline import Pipeline
from collision_monitor.pipeline.preparation import Preparation
from collision_monitor.records import STATE

TURNS = 60


def room(count: int, rng: np.random.Generator) -> np.ndarray:
    """Points on the walls, the floor and a few boxes of a room of 20 m by 20 m by 4 m, in the frame of its middle."""
    points = rng.uniform(-1.0, 1.0, (count, 3)) * (10.0, 10.0, 2.0)
    which = rng.integers(0, 6, count)
    for k in range(3):
        points[which == k, k] = (10.0, 10.0, 2.0)[k]
        points[which == k + 3, k] = (-10.0, -10.0, -2.0)[k]
    return points + 0.01 * rng.normal(size=points.shape)


def measure(parts: dict[str, Callable[[], object]]) -> None:
    """Print the times of the parts, run in turns."""
    times: dict[str, list[float]] = {name: [] for name in parts}
    for _ in range(TURNS):
        for name, part in parts.items():
            begin = perf_counter()
            part()
            times[name].append(1e3 * (perf_counter() - begin))
    for name, each in times.items():
        print(f"{name:34s} {np.median(each):8.3f} median {min(each):8.3f} best")


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--points", type=int, default=20_000)
    parser.add_argument("--robots", type=int, default=100)
    options = parser.parse_args()
    rng = np.random.default_rng(0)
    scans = [room(options.points, rng) for _ in range(TURNS + 2)]  # a sensor never sends the same points again
    messages = [
        encode_descriptions(0, "world", [ObjectDescription(1, cm.Points(scan, 0.03), static=True, pose=cm.Pose())])
        for scan in scans
    ]
    states = np.zeros(options.robots, STATE)
    states["id"] = 10 + np.arange(options.robots)
    states["quaternion"][:, 3] = 1.0
    states["position"] = rng.uniform(-9.0, 9.0, (options.robots, 3)) * (1.0, 1.0, 0.1)
    states["linear"][:, :2] = rng.normal(size=(options.robots, 2))
    pipeline = Pipeline("balanced", "world", timed=False, preparation=Preparation())
    shapes = cm.Box((0.8, 0.6, 0.5)), cm.Capsule(0.3, 1.0), cm.Cylinder(0.4, 0.8)
    objects = [ObjectDescription(int(i), shapes[int(i) % 3]) for i in states["id"]]
    pipeline.on_shapes(encode_descriptions(0, "world", objects))
    stamp = [0]

    def describe() -> None:
        assert len(pipeline.on_shapes(messages[stamp[0]])) == 1

    def step() -> None:
        stamp[0] += 1
        states["position"] += 0.02 * states["linear"]
        pipeline.monitor.step(stamp[0] * 20_000_000, states)

    describe()
    step()
    measure({
        "tree": lambda: cloud_tree(scans[stamp[0]]),
        "message to description, with tree": describe,
        f"step, {options.robots} robots": step,
    })  # fmt: skip
    last = pipeline.monitor.last
    assert last is not None
    print(f"{len(last.contact_rows)} contacts, {len(last.predictions)} predictions")


if __name__ == "__main__":
    main()
