"""Measure the tightness of each bounding volume and the time to build it.

Prints two Markdown tables: volume relative to the convex hull's, and milliseconds per construction (median).

    python benchmarks/bounding_volumes.py
"""

from __future__ import annotations

import statistics
import time
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import ConvexHull as Qhull
from scipy.spatial import HalfspaceIntersection

from collision_monitor.geometry.bounding_spheres import (
    minimal_sphere,
    sphere_from_centroid,
    sphere_from_widest_pair,
    sphere_grown,
)
from collision_monitor.geometry.bounding_volumes import KDOP_DIRECTIONS, Kdop, aabb, convex_hull, kdop_of_points
from collision_monitor.geometry.oriented_boxes import obb_minimum_volume, obb_pca

Array = NDArray[np.float64]
COUNT = 1000
RUNS = 7


def point_sets() -> dict[str, Array]:
    """Sets of 1000 points, turned so that no set is aligned with the axes by chance."""
    rng = np.random.default_rng(0)
    turn = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    on_ball = rng.normal(size=(COUNT, 3))
    on_ball /= np.linalg.norm(on_ball, axis=1, keepdims=True)
    on_box = rng.uniform(-1, 1, (COUNT, 3))
    face = rng.integers(3, size=COUNT)
    on_box[np.arange(COUNT), face] = np.sign(on_box[np.arange(COUNT), face])
    angle = rng.uniform(0, 2 * np.pi, (2, COUNT))
    ring = 2 + 0.5 * np.cos(angle[1])
    torus = np.array([ring * np.cos(angle[0]), ring * np.sin(angle[0]), 0.5 * np.sin(angle[1])]).T
    on_long_arm, unit = rng.random((COUNT, 1)) < 0.5, rng.random((COUNT, 3))
    bracket = unit * np.where(on_long_arm, [4, 1, 1], [1, 3, 1])
    sets = {
        "box 3:2:1": on_box * [3, 2, 1],
        "ball": on_ball,
        "rod 20:1": on_ball * [20, 1, 1],
        "torus": torus,
        "L bracket": bracket,
        "normal cloud": rng.normal(size=(COUNT, 3)) * [1, 2, 3],
    }
    return {name: points @ turn.T for name, points in sets.items()}


def kdop_volume(slabs: Kdop, inner: Array) -> float:
    """Volume of a k-DOP (m³) from the corners at which its planes meet; `inner`: a point (3,) in it."""
    upper = np.column_stack([slabs.directions, -slabs.upper])
    lower = np.column_stack([-slabs.directions, slabs.lower])
    return float(Qhull(HalfspaceIntersection(np.vstack([upper, lower]), inner).intersections).volume)


BUILDS: dict[str, Callable[[Array], float]] = {
    "AABB": lambda points: float(aabb(points).volume),
    "sphere, centroid": lambda points: float(sphere_from_centroid(points).volume),
    "sphere, widest pair": lambda points: float(sphere_from_widest_pair(points).volume),
    "sphere, grown (Ritter)": lambda points: float(sphere_grown(points).volume),
    "sphere, minimal (Welzl)": lambda points: float(minimal_sphere(points).volume),
    "OBB, PCA": lambda points: float(obb_pca(points).volume),
    "OBB, minimum volume": lambda points: float(obb_minimum_volume(points).volume),
    "convex hull": lambda points: convex_hull(points).volume,
}


def milliseconds(build: Callable[[], object]) -> float:
    """Median time of a few runs (ms)."""
    times = []
    for _ in range(RUNS):
        start = time.perf_counter()
        build()
        times.append(1e3 * (time.perf_counter() - start))
    return statistics.median(times)


def main() -> None:
    """Measure and print the tables."""
    sets = point_sets()
    volume: dict[str, list[float]] = {}
    cost: dict[str, list[float]] = {}
    for name, build in BUILDS.items():
        volume[name] = [build(points) for points in sets.values()]
        cost[name] = [milliseconds(lambda b=build, p=points: b(p)) for points in sets.values()]  # type: ignore[misc]
    for k in KDOP_DIRECTIONS:
        slabs = [kdop_of_points(points, k) for points in sets.values()]
        middles = [points.mean(axis=0) for points in sets.values()]
        volume[f"{k}-DOP"] = [kdop_volume(s, middle) for s, middle in zip(slabs, middles, strict=True)]
        cost[f"{k}-DOP"] = [milliseconds(lambda p=points, k=k: kdop_of_points(p, k)) for points in sets.values()]  # type: ignore[misc]
    hull = volume["convex hull"]
    order = [name for name in BUILDS if name != "convex hull"] + [f"{k}-DOP" for k in KDOP_DIRECTIONS] + ["convex hull"]
    for title, table, digits in (
        ("volume / hull", {n: np.divide(volume[n], hull) for n in order}, 2),
        ("ms", {n: np.array(cost[n]) for n in order}, 3),
    ):
        print(f"| {title} | " + " | ".join(sets) + " |")
        print("|---|" + "---:|" * len(sets))
        for name in order:
            print(f"| {name} | " + " | ".join(f"{x:.{digits}f}" for x in table[name]) + " |")
        print()


if __name__ == "__main__":
    main()
