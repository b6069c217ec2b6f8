"""Maps: time to build and to update them, what they cost a step of 50 robots, and 100,000 pairs against brute force.

python benchmarks/maps.py [--pairs 100000]
"""

from __future__ import annotations

import argparse
import statistics
import time
from collections.abc import Callable
from typing import Any, Final

import fcl
import numpy as np

import collision_monitor as cm
from collision_monitor.meshes.trees.shape_trees import kept_tree

EDGE: Final = 0.05
ROBOTS: Final = 50


def warehouse(noise: float = 0.0) -> Any:
    """2,000 x 2,000 cells: walls, 105 racks and 400 pallets; noise: part of the cells at an edge that are wrong."""
    rng, cells = np.random.default_rng(0), np.zeros((2000, 2000), bool)
    for row in range(60, 1900, 120):
        for column in range(100, 1900, 300):
            cells[row : row + 24, column : column + 220] = True
    cells[:3] = cells[-3:] = cells[:, :3] = cells[:, -3:] = True
    for row, column in rng.integers(0, 1990, (400, 2)):
        cells[row : row + 8, column : column + 8] = True
    at_edge = (np.roll(cells, 1, 0) != cells) | (np.roll(cells, 1, 1) != cells)
    return cells ^ (at_edge & (rng.random(cells.shape) < noise))


def milliseconds(call: Callable[[], Any], repeats: int = 7) -> float:
    """Median time of a call."""
    times = []
    for _ in range(repeats):
        begin = time.perf_counter()
        call()
        times.append(1e3 * (time.perf_counter() - begin))
    return statistics.median(times)


def grids() -> None:
    """Build and update grids."""
    rng = np.random.default_rng(1)
    for name, noise in (("clean", 0.0), ("noisy", 0.1)):
        cells = warehouse(noise)
        grid = cm.Grid(cells, EDGE)
        monitor = cm.Monitor()
        monitor.add(1, grid, static=True, pose=(0, 0, 0))
        print(f"{name} grid of {cells.size} cells: {grid.face_count} triangles in {len(grid.tiles)} tiles")
        print(f"  surface and tree      {milliseconds(lambda c=cells: kept_tree(cm.Grid(c, EDGE))):8.1f} ms")
        known = [grid]

        def update(known: list[cm.Grid] = known, monitor: cm.Monitor = monitor) -> None:
            row, column = rng.integers(0, 1900, 2).tolist()
            window = known[0].cells[row : row + 100, column : column + 100] == 1
            window[40:48, 30:38] = True  # a pallet
            known[0] = known[0].updated(row, column, window)
            monitor.add(1, known[0], static=True, pose=(0, 0, 0), replace=True)

        print(f"  update of 100 x 100   {milliseconds(update, 31):8.1f} ms")
        points = np.argwhere(cells)[:, ::-1] * EDGE
        cloud = np.column_stack([points, np.full(len(points), 0.5)])[:500_000]
        print(f"  as cm.Points ({len(cloud)}) {milliseconds(lambda c=cloud: kept_tree(cm.Points(c, EDGE))):8.1f} ms")
        print(f"  50 robots in it, more {_step(grid) - _step(None):8.2f} ms a step")
        print(f"  the same with Points  {_step(cm.Points(cloud, EDGE)) - _step(None):8.2f} ms a step")


def _step(thing: Any) -> float:
    """Median time (ms) of a step of robots that drive along the aisles."""
    rng, monitor = np.random.default_rng(2), cm.Monitor()
    if thing is not None:
        monitor.add(1, thing, static=True, pose=(0, 0, 0))
    poses, twists = np.zeros((ROBOTS, 7)), np.zeros((ROBOTS, 6))
    poses[:, 0], poses[:, 1] = rng.uniform(5, 95, ROBOTS), EDGE * (60 + 120 * rng.integers(0, 15, ROBOTS) - 40)
    poses[:, 2], poses[:, 6], twists[:, 0] = 0.3, 1.0, rng.uniform(-1.5, 1.5, ROBOTS)
    for k in range(ROBOTS):
        monitor.add(2 + k, cm.Box((0.9, 0.6, 0.5)))
    ids, times = np.arange(2, 2 + ROBOTS), []
    for k in range(120):
        turn = rng.normal(0, 0.02, ROBOTS)  # they steer, so that their predictions are made anew
        twists[:, 1] = turn
        poses[:, :2] += 0.05 * twists[:, :2]
        begin = time.perf_counter()
        monitor.step(stamp=0.05 * k, ids=ids, poses=poses, twists=twists)
        times.append(1e3 * (time.perf_counter() - begin))
    return statistics.median(times[20:])


def leaves(count: int, rough: int) -> Any:
    """About so many cells of floors, walls and shelves, of which the surface is rough by some cells."""
    rng, side = np.random.default_rng(3), int((count / 1.25) ** 0.5)
    u, v = (each.ravel() for each in np.mgrid[0:side, 0 : side // 2])
    floor = np.column_stack([u, v, rng.integers(0, rough + 1, len(u))])
    wall = np.column_stack([u, rng.integers(0, rough + 1, len(u)), v + 5])
    shelf = np.column_stack([u[: len(u) // 2], v[: len(u) // 2], 60 + rng.integers(0, rough + 1, len(u) // 2)])
    return np.unique(np.concatenate([floor, wall, shelf]), axis=0)


def voxels() -> None:
    """Build voxel maps, beside clouds of the same points."""
    for rough in (0, 1):
        cells = leaves(500_000, rough)
        shape = cm.Voxels(cells, EDGE)
        print(f"{len(cells)} leaves, rough by {rough} cells: {shape.face_count} triangles")
        print(f"  surface and tree      {milliseconds(lambda c=cells: kept_tree(cm.Voxels(c, EDGE)), 3):8.1f} ms")
        points = (cells + 0.5) * EDGE
        cloud = milliseconds(lambda p=points: kept_tree(cm.Points(p[:500_000], EDGE)), 3)
        print(f"  as cm.Points          {cloud:8.1f} ms")


def pairs(count: int) -> None:
    """Distances and overlaps of spheres with maps against closed forms over the cells."""
    rng, wrong, worst = np.random.default_rng(4), 0, 0.0
    for k in range(20):
        filled = rng.random((64, 100)) < rng.uniform(0.02, 0.6)
        if k % 2:
            cells = np.argwhere(rng.random((24, 20, 14)) < rng.uniform(0.02, 0.4))
            shape, low = cm.Voxels(cells, 0.5), 0.5 * cells
            high = low + 0.5
        else:
            low = np.column_stack([0.5 * np.argwhere(filled)[:, ::-1], np.zeros(filled.sum())])
            shape, high = cm.Grid(filled, 0.5, 1.0), low + np.array([0.5, 0.5, 1.0])
        p = rng.uniform(low.min(0) - 0.5, high.max(0) + 0.5, (count // 20, 3))
        radius = float(rng.uniform(0.01, 0.5))
        poses = np.column_stack([p, np.zeros((len(p), 3)), np.ones(len(p))])
        found = cm.contacts(shape, cm.Pose(), cm.Sphere(radius), poses)
        gap = np.concatenate([_gaps(part, low, high) for part in np.array_split(p, 50)]) - radius
        wrong += int((found.overlaps != (gap <= 0.0)).sum())
        worst = max(worst, float(np.abs(found.signed_distance - gap)[gap > 0.0].max()))
    print(f"{20 * (count // 20)} spheres against brute force: {wrong} overlaps wrong, distances off by {worst:.1e} m")


def _gaps(p: Any, low: Any, high: Any) -> Any:
    return np.sqrt(((np.clip(p[:, None], low, high) - p[:, None]) ** 2).sum(axis=2).min(axis=1))


def against_fcl() -> None:
    """A box at a time against a map, beside a mesh of python-fcl with the same faces: it has no octree."""
    cells = np.argwhere(np.random.default_rng(5).random((60, 60, 20)) < 0.1)
    shape = cm.Voxels(cells, 0.1)
    mesh = fcl.BVHModel()
    mesh.beginModel(len(shape.vertices), len(shape.faces))
    mesh.addSubModel(shape.vertices, shape.faces)
    mesh.endModel()
    own, box = fcl.CollisionObject(mesh), fcl.Box(0.3, 0.2, 0.1)
    places = np.random.default_rng(6).uniform(0, 6, (2000, 3)) * (1, 1, 0.3)
    poses = np.column_stack([places, np.zeros((2000, 3)), np.ones(2000)])
    ours = milliseconds(lambda: cm.contacts(shape, cm.Pose(), cm.Box((0.3, 0.2, 0.1)), poses).overlaps, 3)
    theirs = milliseconds(
        lambda: [fcl.distance(own, fcl.CollisionObject(box, fcl.Transform(each))) for each in places], 3
    )
    print(f"a box and {len(cells)} voxels, distance: {ours / 2:.1f} us; fcl, the same triangles: {theirs / 2:.1f} us")


def main() -> None:
    """Print all figures."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--pairs", type=int, default=100_000)
    count = parser.parse_args().pairs
    grids()
    voxels()
    against_fcl()
    pairs(count)


if __name__ == "__main__":
    main()
