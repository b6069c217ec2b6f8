"""Measure the bounds on the distance of two sphere trees after each level, and their cost, as a Markdown table.

OPENBLAS_NUM_THREADS=1 python benchmarks/sphere_trees.py
"""

from __future__ import annotations

import time

from space_partitions import torus

import collision_monitor as cm
from collision_monitor.geometry.lecture.sphere_tree import distance_intervals, sphere_tree


def main() -> None:
    """Measure and print two rings of 256 triangles, and two of 4,096."""
    X, Y = cm.Pose(), cm.Pose((2.0, 0.5, 1.2), (0.5, 0.5, 0.5, 0.5))
    print("| triangles | s to build | distance | level | spheres | at least | at most | ms |")
    print("|---:|---:|---:|---:|---:|---:|---:|---:|")
    for major, minor in ((16, 8), (64, 32)):
        vertices, faces = torus(major, minor)
        begin = time.process_time()
        tree = sphere_tree(vertices, faces, depth=6)
        build = time.process_time() - begin
        ring = cm.Mesh(vertices, faces)
        true = cm.contact(ring, X, ring, Y).signed_distance
        list(distance_intervals(tree, X, tree, Y))  # warms up
        begin = time.process_time()
        cells = f"{len(faces):,} | {build:.1f} | {true:.4f}"
        for k, interval in enumerate(distance_intervals(tree, X, tree, Y)):
            cost = 1e3 * (time.process_time() - begin)
            spheres = len(tree[k].radius)
            print(f"| {cells} | {k} | {spheres:,} | {interval.lower:.4f} | {interval.upper:.4f} | {cost:.1f} |")
            cells = " | | "


if __name__ == "__main__":
    main()
