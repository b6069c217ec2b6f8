"""Time of `cm.conflicts` on fleets that drive through a warehouse, and of sampling their plans with FCL.

    nice python benchmarks/conflicts.py                     # the table of docs/conflicts.md
    nice python benchmarks/conflicts.py --robots 100        # one size

Robots drive between random stations for 60 s at 0.5 to 1.5 m/s among shelves, along arcs or lines. Each row varies one
of: robots, s between two points, shape, m² per robot. Times are the least of three calls, after a first one. Sampling:
FCL at 15 poses (`--samples`) of each pair of segments whose boxes meet in space and time, as Open-RMF does; its
conflicts are the pairs that a sample met.
"""

from __future__ import annotations

import argparse
import sys
import time
from itertools import pairwise, product
from typing import Any, NamedTuple

import fcl
import numpy as np
from numpy.typing import NDArray

import collision_monitor as cm

Array = NDArray[np.float64]
SECONDS = 60.0
SHELVES = 0.02
"""Shelves per robot and m² that it has."""


class Scene(NamedTuple):
    """Shapes and plans of robots, and shelves with their poses."""

    robots: dict[str, Any]
    plans: dict[str, cm.Trajectory]
    shelves: list[tuple[Any, tuple[float, ...]]]


def robot_shape(kind: str, k: int) -> Any:
    """The shape of robot k."""
    kinds = ("box", "capsule", "hull", "compound")
    corners = [(x * (0.7 if z > 0 else 1.0), y, z) for x, y, z in product((-0.6, 0.6), (-0.4, 0.4), (-0.3, 0.3))]
    match kinds[k % len(kinds)] if kind == "mixed" else kind:
        case "box":
            return cm.Box((1.2, 0.8, 0.6))
        case "circle":
            return cm.Circle(0.5)
        case "sphere":
            return cm.Sphere(0.5)
        case "capsule":
            return cm.Capsule(0.4, 0.6)
        case "hull":
            return cm.ConvexHull(corners)
        case "compound":
            return [(cm.Box((1.2, 0.8, 0.6)), cm.Pose()), (cm.Box((0.2, 0.2, 1.5)), cm.Pose((0.4, 0.0, 0.9)))]
        case _:
            raise ValueError(kind)


def warehouse(robots: int, step: float, shape: str, area: float, seed: int = 1) -> Scene:
    """Make a scene. step: s between two points; area: m² per robot."""
    rng = np.random.default_rng(seed)
    side = float(np.sqrt(robots * area))
    times = np.arange(0.0, SECONDS + 0.5 * step, step)
    shapes, plans = {}, {}
    for k in range(robots):
        at, speed, points, heading = rng.uniform(0.0, side, 2), rng.uniform(0.5, 1.5), [], []
        target = rng.uniform(0.0, side, 2)
        angle = float(np.arctan2(*(target - at)[::-1]))
        for _ in times:
            points.append((*at, 0.3))
            heading.append(angle)
            way = target - at
            if np.hypot(*way) < speed * step or rng.random() < 0.02:
                target = np.clip(at + rng.normal(0.0, 15.0, 2), 0.0, side)
                way = target - at
            wanted = float(np.arctan2(way[1], way[0]))
            turn = (wanted - angle + np.pi) % (2.0 * np.pi) - np.pi
            angle += float(np.clip(turn, -0.8 * step, 0.8 * step))
            at = at + speed * step * np.array([np.cos(angle), np.sin(angle)])
        half = 0.5 * np.array(heading)
        poses = np.column_stack([points, np.zeros((len(times), 2)), np.sin(half), np.cos(half)])
        name = f"robot_{k}"
        shapes[name] = robot_shape(shape, k)
        plans[name] = cm.Trajectory(times, poses, between="arc" if k % 2 else "straight")
    count = max(int(SHELVES * robots * area / 5.0), 1)
    solid: Any = (
        cm.Polygon([(-4, -0.5), (4, -0.5), (4, 0.5), (-4, 0.5)]) if shape == "circle" else cm.Box((8.0, 1.0, 3.0))
    )
    places = rng.uniform(0.0, side, (count, 2)).tolist()
    return Scene(shapes, plans, [(solid, (x, y, 0.0 if shape == "circle" else 1.5)) for x, y in places])


def timed(scene: Scene) -> tuple[float, list[cm.Conflict]]:
    """The least time of three calls (s), and the conflicts."""
    cm.conflicts(scene.robots, scene.plans, scene.shelves)
    seconds = []
    for _ in range(3):
        begin = time.perf_counter()
        found = cm.conflicts(scene.robots, scene.plans, scene.shelves)
        seconds.append(time.perf_counter() - begin)
    return min(seconds), found


def sampled(scene: Scene, samples: int) -> tuple[float, set[frozenset[str]]]:
    """Time (s) of sampling each pair of segments whose boxes meet, and the pairs of robots that a sample met."""
    begin = time.perf_counter()
    names, plans = list(scene.robots), list(scene.plans.values())
    solids = [fcl.CollisionObject(fcl.Box(1.2, 0.8, 0.6)) for _ in names]
    times = plans[0].times
    at = [[plan.rows(np.linspace(a, b, samples)) for a, b in pairwise(times)] for plan in plans]
    met: set[frozenset[str]] = set()
    for k in range(len(times) - 1):
        ways = np.array([rows[k][:, :3] for rows in at])
        low, high = ways.min(axis=1) - 0.75, ways.max(axis=1) + 0.75
        order = np.argsort(low[:, 0])
        ends = np.searchsorted(low[order, 0], high[order, 0], side="right")
        for place, i in enumerate(order.tolist()):
            for j in order[place + 1 : ends[place]].tolist():
                if (low[i] <= high[j]).all() and (low[j] <= high[i]).all():
                    for row_i, row_j in zip(at[i][k], at[j][k], strict=True):
                        for solid, row in ((solids[i], row_i), (solids[j], row_j)):
                            solid.setTransform(fcl.Transform(row[[6, 3, 4, 5]], row[:3]))
                        if fcl.collide(solids[i], solids[j], fcl.CollisionRequest(), fcl.CollisionResult()):
                            met.add(frozenset((names[i], names[j])))
                            break
    return time.perf_counter() - begin, met


def main() -> int:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--robots", type=int, help="one row with so many robots")
    parser.add_argument("--samples", type=int, default=15, help="poses of a segment")
    parser.add_argument("--most-sampled", type=int, default=200, help="largest fleet that is sampled too")
    args = parser.parse_args()
    rows = [(20, 0.5, "box", 50.0), (100, 0.5, "box", 50.0), (100, 1.0, "box", 50.0), (100, 0.1, "box", 50.0),
            (100, 0.5, "circle", 50.0), (100, 0.5, "mixed", 50.0), (100, 0.5, "box", 10.0), (100, 0.5, "box", 500.0),
            (300, 0.5, "box", 50.0), (1000, 1.0, "box", 50.0), (1000, 0.5, "box", 50.0), (1000, 0.5, "mixed", 50.0),
            (1000, 0.5, "box", 10.0), (3000, 0.5, "box", 50.0)]  # fmt: skip
    if args.robots:
        rows = [(args.robots, 0.5, "box", 50.0)]
    print("robots  s/point  shape   m²/robot  conflicts  unresolved  seconds  sampled with FCL (pairs)")
    for robots, step, shape, area in rows:
        scene = warehouse(robots, step, shape, area)
        seconds, found = timed(scene)
        open_ones = sum(each.status == "unresolved" for each in found)
        line = f"{robots:6} {step:8} {shape:>7} {area:9} {len(found):10} {open_ones:11} {seconds:8.3f}"
        if shape == "box" and robots <= args.most_sampled:
            took, met = sampled(scene, args.samples)
            ours = {frozenset((each.a, each.b)) for each in found if each.b in scene.robots}
            line += f"  {took:7.1f} s ({len(met)} of {len(ours)}, {len(met - ours)} others)"
        print(line, flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(main())
