"""Compile every kernel the monitor uses, so that the first step of a session does not wait for the compiler."""

from __future__ import annotations

import numpy as np

from collision_monitor.geometry.pose import Pose
from collision_monitor.geometry.shapes import Box, Sphere
from collision_monitor.monitor import Monitor


def main() -> None:
    """Step a small scene through all that a step can do; the compiled kernels stay in the cache."""
    monitor = Monitor()
    monitor.add(0, Box((10, 10, 1)), static=True, pose=Pose((0, 0, -0.5)))
    for object_id in (1, 2, 3):
        monitor.add(object_id, Sphere(0.5) if object_id == 1 else Box((1, 1, 1)))
    poses = np.zeros((3, 7))
    poses[:, 6] = 1.0
    poses[:, 2] = 2.0
    twists = np.zeros((3, 6))
    twists[:, 2] = -1.0
    for step in range(4):
        poses[:, 0] = (0.0, 0.8, 3.0 - step)
        monitor.step(step * 1_000_000_000, [1, 2, 3], poses, twists)
    monitor.remove(1)
    monitor.step(4_000_000_000, [2, 3], poses[1:], twists[1:])


if __name__ == "__main__":
    main()
