"""Compile every kernel the monitor uses, so that the first step of a session does not wait for the compiler."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from collision_monitor.geometry.pose import Pose
from collision_monitor.geometry.shapes import Box, Sphere
from collision_monitor.monitor import Monitor
from collision_monitor.records import STATE

OBJECTS = 70  # more than the arrays have room for at first: growing them is warmed up too


def main() -> None:
    """Step a small scene through all that a step can do; the compiled kernels stay in the cache."""
    monitor = Monitor()
    monitor.add(OBJECTS, Box((500, 10, 1)), static=True, pose=Pose((0, 0, -0.5)))
    for object_id in range(OBJECTS):
        monitor.add(object_id, Box((1, 1, 1)) if object_id % 2 else Sphere(0.5))
    poses = np.zeros((OBJECTS, 7))
    poses[:, 6] = 1.0
    poses[:, 0] = 0.9 * np.arange(OBJECTS)
    poses[:, 2] = 2.0
    twists = np.zeros((OBJECTS, 6))
    twists[:, 2] = -1.0
    twists[0] = (1.0, 0.0, -1.0, 0.5, 0.0, 0.0)
    for step in range(20):
        monitor.step(step * 100_000_000, np.arange(OBJECTS), poses, twists)
        poses[:, :3] += 0.1 * twists[:, :3]
        twists[step, :] *= -1.0  # one leaves its motion
    monitor.remove(1)
    monitor.step(3_000_000_000, np.arange(2, OBJECTS), poses[2:], twists[2:])
    _step_uncertain(monitor, poses[2:])
    monitor.profile = monitor.profile.replace(pairs_per_step=1, contact_points=4)
    for step in range(2):
        monitor.step(4_000_000_000 + step * 10_000_000, np.arange(2, OBJECTS), poses[2:], twists[2:])


def _step_uncertain(monitor: Monitor, poses: NDArray[np.float64]) -> None:
    """The same with states that declare an uncertainty, with covariances, and with a bound on an acceleration."""
    states = np.zeros(len(poses), STATE)
    states["id"] = np.arange(2, OBJECTS)
    states["position"], states["quaternion"] = poses[:, :3], poses[:, 3:]
    states["position_stddev"] = states["orientation_stddev"] = 0.1
    monitor.step(3_010_000_000, states)
    monitor.add(2, Sphere(0.5), max_linear_acceleration=1.0)
    monitor.step(3_020_000_000, states, covariance=np.zeros((len(poses), 12)))


if __name__ == "__main__":
    main()
