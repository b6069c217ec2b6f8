"""Time a static map of a million triangles: making it, and steps of 100 robots that turn and move above it.

    python benchmarks/mesh_map.py                20 s, after the kernels are compiled

Half of the robots are boxes, which meet the map tree against tree, and half cylinders, which have no triangles. Every
30 steps all robots get new twists, so that all pairs are predicted anew; these are the slowest steps.
"""

from __future__ import annotations

import sys
import time

import numpy as np
from mesh_memory import terrain
from scipy.spatial.transform import Rotation

import collision_monitor as cm

SIDE = 708
ROBOTS = 100
STEPS = 180
RENEWED = 30
PERIOD = 0.02
"""Vertices along each side; steps between two sets of twists; seconds between two steps."""


def main() -> int:
    """Print the seconds to make the map, and the milliseconds of the steps."""
    rng = np.random.default_rng(1)
    vertices, faces = terrain(SIDE)
    vertices[:, 2] += 0.02 * rng.normal(size=len(vertices))
    begin = time.perf_counter(), time.process_time()
    monitor = cm.Monitor()
    monitor.add(1, cm.Mesh(vertices, faces), static=True, pose=cm.Pose(), name="map")
    wall, processor = time.perf_counter() - begin[0], time.process_time() - begin[1]
    print(f"map of {len(faces)} triangles: made and described in {wall:.2f} s, {processor:.2f} s of processor time")
    ids = np.arange(2, ROBOTS + 2)
    for k in ids.tolist():
        monitor.add(k, cm.Box((0.8, 0.6, 0.4)) if k % 2 else cm.Cylinder(0.3, 0.5))
    p = np.column_stack([rng.uniform(-45, 45, (ROBOTS, 2)), rng.uniform(0.9, 1.6, ROBOTS)])
    turn, spent = Rotation.random(ROBOTS, rng=rng), []
    v = w = np.zeros((ROBOTS, 3))
    for step in range(STEPS):
        if step % RENEWED == 0:
            v = rng.normal(size=(ROBOTS, 3)) * [1.0, 1.0, 0.05]
            w = 0.5 * rng.normal(size=(ROBOTS, 3))
        poses, twists = np.column_stack([p, turn.as_quat()]), np.column_stack([v, w])
        begun = time.perf_counter()
        monitor.step(int(1e9 * PERIOD * step), ids, poses, twists)
        spent.append(1e3 * (time.perf_counter() - begun))
        p, turn = p + PERIOD * v, Rotation.from_rotvec(PERIOD * w) * turn
    anew = np.array(spent[RENEWED::RENEWED])
    print(f"steps of {ROBOTS} robots: median {np.median(spent):.2f} ms; all pairs anew: {np.round(anew, 1)} ms")
    return 0


if __name__ == "__main__":
    sys.exit(main())
