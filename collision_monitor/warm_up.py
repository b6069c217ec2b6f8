"""Compile every kernel in advance, so that neither a session's first step nor a first call waits for the compiler.

    python -m collision_monitor.warm_up [monitor | functions]      without an argument: both, one after the other
"""

from __future__ import annotations

import sys

import numpy as np
from numpy.typing import NDArray

from collision_monitor.alerts.alerts import Alerts
from collision_monitor.alerts.rules import Rules
from collision_monitor.geometry.pose import Motion, Pose
from collision_monitor.geometry.shapes import Box, ConvexHull, Mesh, Shape, Sphere
from collision_monitor.monitor.monitor import Monitor
from collision_monitor.objects.models import containing_model
from collision_monitor.records import STATE, Model

OBJECTS = 70  # more than the initial capacity of the arrays, so that growing them is compiled too


def warm_up_monitor() -> None:
    """Step a small scene through every part of a step; the compiled kernels stay in the cache."""
    monitor = Monitor()
    monitor.add(OBJECTS, Box((500, 10, 1)), static=True, pose=Pose((0, 0, -0.5)))
    for object_id in range(OBJECTS):
        monitor.add(object_id, Box((1, 1, 1)) if object_id % 2 else Sphere(0.5))
    # the excess of a model has a kernel too; without this, the first concave mesh would hold up the answers
    containing_model([(ConvexHull(np.vstack([np.zeros(3), np.eye(3)])), Pose())], Model.AABB)
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
        twists[step, :] *= -1.0  # one object leaves its predicted motion
    monitor.remove(1)
    monitor.step(3_000_000_000, np.arange(2, OBJECTS), poses[2:], twists[2:])
    _step_uncertain(monitor, poses[2:])
    for step, pairs in enumerate((1, 1, 1_000_000)):  # the last step has time for the pairs that the others deferred
        monitor.profile = monitor.profile.replace(pairs_per_step=pairs, contact_points=4)
        monitor.step(4_000_000_000 + step * 10_000_000, np.arange(2, OBJECTS), poses[2:], twists[2:])


def _step_uncertain(monitor: Monitor, poses: NDArray[np.float64]) -> None:
    """Step with states that declare an uncertainty, with covariances, and with a bound on an acceleration."""
    states = np.zeros(len(poses), STATE)
    states["id"] = np.arange(2, OBJECTS)
    states["position"], states["quaternion"] = poses[:, :3], poses[:, 3:]
    states["position_stddev"] = states["orientation_stddev"] = 0.1
    monitor.step(3_010_000_000, states)
    monitor.add(2, Sphere(0.5), max_linear_acceleration=1.0, replace=True)
    monitor.step(3_020_000_000, states, covariance=np.zeros((len(poses), 12)))


def warm_up_alerts() -> None:
    """Evaluate rules about states once. A node without rules does not need their kernels."""
    monitor = Monitor()
    monitor.add(1, Box((1, 1, 1)))
    monitor.add(2, Sphere(0.5))
    result = monitor.step(0, [1, 2], np.array([[0, 0, 0, 0, 0, 0, 1], [2, 0, 0, 0, 0, 0, 1]]))
    level = "{distance: 2, distance_at_closest_approach: 2}"
    alerts = Alerts(Rules.parse(f"rules: {{near: {{between: [any, any], caution: {level}, quiet_at_rest: false}}}}"))
    alerts.step(monitor, result, "", str)


def warm_up_functions() -> None:
    """Call the functions that need no monitor, once with each kind of argument that has a kernel of its own."""
    warm_up_alerts()
    # imported here because a node, which warms up the monitor at its start, needs none of it
    from collision_monitor.detection.detector import WORTH_THREADS, Detector, default_threads
    from collision_monitor.query.contact import contact
    from collision_monitor.query.contacts import contacts
    from collision_monitor.query.feature_impact import vertex_face_impact
    from collision_monitor.query.overlap import overlap
    from collision_monitor.query.time_of_impact import time_of_impact
    from collision_monitor.query.time_of_impact_batch import time_of_impact_batch

    box, ball = Box((1, 1, 1)), Sphere(0.5)
    for threads in sorted({1, default_threads()}):
        shapes: list[Shape] = [box, ball] * WORTH_THREADS
        positions = np.arange(3.0 * len(shapes)).reshape(-1, 3)
        Detector(shapes, threads=threads).detect(positions, np.tile([0.0, 0.0, 0.0, 1.0], (len(shapes), 1)))
    contact(box, Pose(), ball, Pose())
    contact([(box, Pose())], Pose(), ball, Pose())  # the general search
    time_of_impact(box, Motion(Pose(), angular=(0, 0, 1)), ball, Motion(Pose((3, 0, 0)), acceleration=(-1, 0, 0)))
    poses, twists = np.zeros((2, 7)), np.zeros((2, 6))
    poses[:, 6] = 1.0
    contacts(box, poses, ball, poses + np.eye(1, 7))
    for shape in (box, ball):
        time_of_impact_batch(shape, poses, twists, shape, poses + np.eye(1, 7), twists)
    vertex_face_impact(np.arange(24.0).reshape(8, 3))
    corner = Mesh([(0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1)], [(0, 1, 2), (0, 1, 3)])
    for at in (Pose(), Pose((3, 0, 0))):
        overlap(corner, Pose(), corner, at)
        contact(corner, Pose(), corner, at)


PARTS = {"monitor": warm_up_monitor, "functions": warm_up_functions}


if __name__ == "__main__":
    for part in sys.argv[1:] or PARTS:
        PARTS[part]()
