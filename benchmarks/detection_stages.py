"""Measure each stage of a frame of full detection on one thread, in microseconds.

Usage: python benchmarks/detection_stages.py [SCENE] [N]
"""

from __future__ import annotations

import sys
import time
from collections.abc import Callable

import numpy as np

from collision_monitor._jit import kernel
from collision_monitor.broad_phase.dense_grid import Bounds, partners, places, searches, sort_by_cell
from collision_monitor.broad_phase.size_classes import CLASSES, STARTING
from collision_monitor.detection.detector import Detector, kernels
from collision_monitor.world.moving_bodies import make_moving_bodies


@kernel
def bounds(positions, frame):
    """Compute the bounds of the positions and check that they are finite."""
    kernels._bounds(positions, frame, np.int64(0))


@kernel
def cells(positions, grid, frame):
    """Lay out the cells and assign each body to one; returns the number of cells."""
    number = kernels._cells(grid, frame)
    kernels._buckets(positions, grid, frame, np.int64(0))
    return number


@kernel
def sort(n, number, grid):
    """Sort the bodies by cell (counting sort)."""
    sort_by_cell(n, number, grid)


@kernel
def gather(path, positions, quaternions, grid, frame):
    """Gather centres, sizes and rotation matrices in the order of the cells."""
    kernels._gather(path, positions, quaternions, grid, frame, np.int64(0))


@kernel
def candidates(grid, frame):
    """Count the pairs whose bounding spheres overlap."""
    total = 0
    for a in range(STARTING):
        first, behind = places(grid, a)
        for b in range(CLASSES):
            if searches(grid, a, b):
                for p in range(first, behind):
                    total += partners(grid, Bounds(frame.extent, True), a, b, p, frame.found[0], 0)
    return total


@kernel
def search(table, path, grid, frame, hits):
    """Find the candidates and run the narrow phase."""
    kernels._search(table, path, 0.0, grid, frame, hits, np.int64(0))


@kernel
def finish(positions, frame, hits, pairs, contacts):
    """Sort the contacts and fill the arrays of the answer."""
    total = kernels._finish(frame, hits, pairs)
    kernels._write(positions, frame, hits, total, pairs, contacts, np.int64(0))


def best(action: Callable[[], object], repeats: int = 30) -> float:
    """Shortest time of a call (µs)."""
    action()
    times = []
    for _ in range(repeats):
        begin = time.perf_counter_ns()
        action()
        times.append(time.perf_counter_ns() - begin)
    return min(times) / 1e3


def main(name: str = "boxes", n: str = "10000") -> None:
    """Measure the stages and print the table."""
    scene = make_moving_bodies(name, int(n))
    positions, quaternions = scene.positions[4], scene.quaternions[4]
    detector = Detector(scene.shapes)
    contacts = detector.detect(positions, quaternions)
    table, path, grid, frame, hits = (
        detector._table, detector._path, detector._grid, detector._frame, detector._hits
    )  # fmt: skip
    number = cells(positions, grid, frame)
    pairs, rows = np.empty((len(contacts), 2), np.int32), np.empty((len(contacts), kernels.DETECTED_SIZE))
    found = candidates(grid, frame)
    time_candidates = best(lambda: candidates(grid, frame))
    time_search = best(lambda: search(table, path, grid, frame, hits))
    for stage, microseconds in (
        ("poses: bounds and check", best(lambda: bounds(positions, frame))),
        ("cells", best(lambda: cells(positions, grid, frame))),
        ("sort by cell", best(lambda: sort(len(positions), number, grid))),
        ("gather, rotation matrices", best(lambda: gather(path, positions, quaternions, grid, frame))),
        (f"candidates ({found})", time_candidates),
        (f"narrow phase ({len(contacts)} contacts)", time_search - time_candidates),
        ("sort of contacts, output", best(lambda: finish(positions, frame, hits, pairs, rows))),
        ("whole frame from Python", best(lambda: detector.detect(positions, quaternions))),
    ):
        print(f"{stage:40s}{microseconds:10.1f}")


if __name__ == "__main__":
    main(*sys.argv[1:])
