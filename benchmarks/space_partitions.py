"""Compare the space partitions: processor time (ms) to build one and find all overlapping pairs of boxes.

    python benchmarks/space_partitions.py                 # 1,000 and 10,000 boxes
    python benchmarks/space_partitions.py --boxes 100000

The grids are compiled kernels, the others NumPy. The benchmark checks that all find the same pairs. Prints a Markdown
table.
"""

from __future__ import annotations

import argparse
import statistics
import time
from collections.abc import Callable
from functools import partial
from typing import Final

import numpy as np
from numpy.typing import NDArray

from collision_monitor.broad_phase.bsp_tree import bsp_tree, locate_in_bsp_tree
from collision_monitor.broad_phase.partitions import PARTITIONS
from collision_monitor.cli.output.progress import progress_bar
from collision_monitor.geometry.polyhedra import locate_in_polyhedron

Array = NDArray[np.float64]
RUNS: Final = 5
BRUTE_FORCE: Final = 2000
"""Most boxes for brute force, whose memory grows with the square of their number."""


def crowd(n: int, rng: np.random.Generator) -> tuple[Array, Array]:
    """Boxes of about 1 m in a hall; each meets one or two others."""
    side = (2.0 * n) ** (1 / 3)
    return rng.uniform(0, side, (n, 3)), rng.uniform(0.5, 1.0, (n, 3))


def floor(n: int, rng: np.random.Generator) -> tuple[Array, Array]:
    """The same boxes on one floor, like vehicles."""
    lower, size = rng.uniform(0, (2.0 * n) ** 0.5, (n, 3)), rng.uniform(0.5, 1.0, (n, 3))
    return lower * [1, 1, 0], size


def mixed(n: int, rng: np.random.Generator) -> tuple[Array, Array]:
    """Boxes from bolts of 1 cm to halls of 10 m, with a log-uniform size."""
    size = 10 ** rng.uniform(-2, 1, (n, 1)) * rng.uniform(0.5, 1.0, (n, 3))
    side = (40.0 * n) ** (1 / 3)
    return rng.uniform(0, side, (n, 3)), size


def corridor(n: int, rng: np.random.Generator) -> tuple[Array, Array]:
    """Boxes in a line, as on a road or a belt."""
    return rng.uniform(0, 1, (n, 3)) * [1.2 * n, 2, 2], rng.uniform(0.5, 1.0, (n, 3))


def islands(n: int, rng: np.random.Generator) -> tuple[Array, Array]:
    """Crowds of 50 boxes that are a kilometre apart."""
    centre = 1000.0 * rng.integers(-20, 20, (n // 50 + 1, 3))
    return np.repeat(centre, 50, axis=0)[:n] + rng.uniform(0, 4, (n, 3)), rng.uniform(0.5, 1.0, (n, 3))


SCENES: Final = {"crowd": crowd, "floor": floor, "mixed sizes": mixed, "corridor": corridor, "islands": islands}


def milliseconds(run: Callable[[], object]) -> float:
    """Median processor time of a few runs (ms)."""
    times = []
    for _ in range(RUNS):
        begin = time.process_time()
        run()
        times.append(1e3 * (time.process_time() - begin))
    return statistics.median(times)


def overlaps_table(counts: list[int]) -> None:
    """Print a row for each scene and number of boxes; the fastest of all and the fastest in NumPy are bold."""
    names = list(PARTITIONS)
    print("| scene | boxes | pairs | " + " | ".join(names) + " |")
    print("|---|" + "---:|" * (len(names) + 2))
    with progress_bar("scenes", len(SCENES) * len(counts) * len(names)) as done:
        for scene, make in SCENES.items():
            for n in counts:
                lower, size = make(n, np.random.default_rng(1))
                upper = lower + size
                expected = PARTITIONS["grid"](lower, upper)
                row = {}
                for name, partition in PARTITIONS.items():
                    if name != "brute force" or n <= BRUTE_FORCE:
                        if not np.array_equal(partition(lower, upper), expected):
                            raise SystemExit(f"{scene}: {name} finds other pairs than the grid")
                        row[name] = milliseconds(partial(partition, lower, upper))
                    done(1)
                best = {min(row, key=lambda name: row[name])}
                best.add(min((k for k in row if "grid" not in k), key=lambda name: row[name]))
                cells = [f"**{row[k]:.2f}**" if k in best else f"{row[k]:.2f}" if k in row else "" for k in names]
                print(f"| {scene} | {n:,} | {len(expected):,} | " + " | ".join(cells) + " |", flush=True)


def bsp_table() -> None:
    """Print the cost of locating points in a static solid by the BSP tree and by the exact ray parity."""
    print("\n| faces | nodes | ms to build | µs for a point | by ray parity |")
    print("|---:|---:|---:|---:|---:|")
    rng = np.random.default_rng(2)
    for major, minor in ((16, 8), (32, 16), (64, 32)):
        vertices, faces = torus(major, minor)
        begin = time.process_time()
        tree = bsp_tree(vertices, faces)
        build = 1e3 * (time.process_time() - begin)
        points = rng.uniform(-1.5, 1.5, (20_000, 3))
        if (locate_in_bsp_tree(points, tree) != locate_in_polyhedron(points, vertices, faces)).any():
            raise SystemExit("the BSP tree and the ray parity differ")
        by_tree = milliseconds(partial(locate_in_bsp_tree, points, tree)) / 20
        by_parity = milliseconds(partial(locate_in_polyhedron, points, vertices, faces)) / 20
        print(f"| {len(faces):,} | {len(tree.front):,} | {build:.0f} | {by_tree:.2f} | {by_parity:.2f} |", flush=True)


def torus(major: int, minor: int) -> tuple[Array, NDArray[np.int64]]:
    """Closed mesh of a torus about the origin, radii 1 and 0.3 m."""
    i, j = np.divmod(np.arange(major * minor), minor)
    u, v = 2 * np.pi * i / major, 2 * np.pi * j / minor
    ring = 1 + 0.3 * np.cos(v)
    vertices = np.stack([ring * np.cos(u), ring * np.sin(u), 0.3 * np.sin(v)], axis=1)
    right, up = (i + 1) % major * minor + j, i * minor + (j + 1) % minor
    across = (i + 1) % major * minor + (j + 1) % minor
    here = i * minor + j
    return vertices, np.concatenate([np.stack([here, right, across], 1), np.stack([here, across, up], 1)])


def main() -> None:
    """Measure and print both tables."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--boxes", type=int, nargs="+", default=[1000, 10_000], help="numbers (default 1000 10000)")
    overlaps_table(parser.parse_args().boxes)
    bsp_table()


if __name__ == "__main__":
    main()
