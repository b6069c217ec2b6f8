"""Compile every kernel in advance, so that neither a session's first step nor a first call waits for the compiler.

    python -m collision_monitor.warm_up [monitor | options | functions]     without an argument: one after the other

monitor: the steps of every scene. options: what uncertain states, budgets and contacts of many points need besides.
"""

from __future__ import annotations

import sys
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from collision_monitor.alerts.alerts import Alerts
from collision_monitor.alerts.rules import Rules
from collision_monitor.geometry.point_tree import PointTree
from collision_monitor.meshes.trees.shape_trees import shape_tree
from collision_monitor.monitor.monitor import Monitor
from collision_monitor.monitor.time_critical import TimeCritical
from collision_monitor.motion.stated_motion import Motion
from collision_monitor.motion.trajectory import Trajectory
from collision_monitor.objects.models import containing_model
from collision_monitor.records import MOST_POINTS, STATE, Model
from collision_monitor.settings.profile import NO_BUDGET, NO_LIMIT, Profile
from collision_monitor.shapes.pose import Pose
from collision_monitor.shapes.registry import Box, ConvexHull, Grid, Mesh, Points, Shape, Sphere

Array = NDArray[np.float64]

CERTAIN: Final = Profile(uncertainty=False)
"""The settings whose steps need the fewest kernels."""

_UNLIMITED: Final[dict[str, Any]] = {"budget_ms": NO_BUDGET, "pairs_per_step": NO_LIMIT}

OBJECTS = 140
"""More than the initial capacity of the arrays, so that growing them is compiled too, and so many that one of them is
few enough (`candidates.MOST_QUERIES`) to be searched for in the grid instead of by a sweep."""


def warm_up_monitor(profile: Profile | None = None) -> None:
    """Step a small scene through every part of a step; the compiled kernels stay in the cache.

    profile: leaves out what no step with these settings needs, up to a third of all kernels; None: leaves out nothing.
    """
    monitor = Monitor((profile or Profile()).replace(uncertainty=False, contact_points=1, **_UNLIMITED))
    poses, twists = _step_certain(monitor)
    _step_uncertain(monitor, poses, seconds=4)  # its states are also taken if no setting asks for their uncertainty
    if profile is None or profile.uncertainty:
        monitor.profile = monitor.profile.replace(uncertainty=True)
        _step_uncertain(monitor, poses, seconds=5)
    if profile is None or profile.mesh_impact_tolerance > 0.0:
        _step_bounded_meshes(monitor)
    points = MOST_POINTS if profile is None else profile.contact_points
    if profile is None or TimeCritical.has_budget(profile) or points > 1:
        _step_limited(monitor, poses, twists, points)


def _step_certain(monitor: Monitor) -> tuple[Array, Array]:
    """Step objects that fall and leave their predicted motions. Return the poses and twists of those left."""
    monitor.add(OBJECTS, Box((500, 10, 1)), static=True, pose=Pose((0, 0, -0.5)))
    for object_id in range(OBJECTS):
        monitor.add(object_id, Box((1, 1, 1)) if object_id % 2 else Sphere(0.5))
    # the excess of a model has kernels too; without this, the first concave mesh would hold up the answers
    corners = np.vstack([np.zeros(3), np.eye(3)])
    tetrahedron = Mesh(corners, [[0, 2, 1], [0, 1, 3], [1, 2, 3], [0, 3, 2]])
    containing_model([(ConvexHull(corners), Pose())], Model.AABB)
    PointTree(corners, corners).exceeds(corners, corners[:, 0], np.eye(4), corners[:, 0])  # for large meshes
    containing_model([(tetrahedron, Pose())], Model.AABB)
    shape_tree(Grid(np.arange(200).reshape(1, 200) % 100 == 0, 1.0))  # a map, of two tiles
    monitor.add(OBJECTS - 1, tetrahedron, replace=True)  # a convex mesh names its features by a kernel of its own
    poses = np.zeros((OBJECTS, 7))
    poses[:, 6] = 1.0
    poses[:, 0] = 0.9 * np.arange(OBJECTS)
    poses[:, 2] = 2.0
    twists = np.zeros((OBJECTS, 6))
    twists[:, 2] = -1.0
    twists[0] = (1.0, 0.0, -1.0, 0.5, 0.0, 0.0)
    for step in range(20):
        stamp = step * 100_000_000
        monitor.step(stamp, np.arange(OBJECTS), poses, twists, now_ns=stamp + 1_000_000)  # the age has a kernel
        poses[:, :3] += 0.1 * twists[:, :3]
        twists[step, :] *= -1.0  # one object leaves its predicted motion
    monitor.remove(1)
    monitor.follow(OBJECTS - 2, Trajectory([0, 1], poses[[-2, -2]], between="arc"))
    monitor.step(3_000_000_000, np.arange(2, OBJECTS), poses[2:], twists[2:])
    monitor.follow(OBJECTS - 2, None)
    return poses[2:], twists[2:]


def _step_uncertain(monitor: Monitor, poses: Array, seconds: int) -> None:
    """Step with states that declare an uncertainty, with covariances, and with a bound on an acceleration."""
    stamp = seconds * 1_000_000_000
    states = np.zeros(len(poses), STATE)
    states["id"] = np.arange(2, OBJECTS)
    states["position"], states["quaternion"] = poses[:, :3], poses[:, 3:]
    states["position_stddev"] = states["orientation_stddev"] = 0.1
    monitor.step(stamp, states)
    monitor.add(2, Sphere(0.5), max_linear_acceleration=1.0, replace=True)
    monitor.step(stamp + 10_000_000, states, covariance=np.zeros((len(poses), 12)))
    states["orientation_stddev"] = 1.0  # too large for planes: every sample is followed
    monitor.follow(2, Trajectory([0, 1], poses[[0, 0]]))
    monitor.step(stamp + 20_000_000, states)
    monitor.follow(2, None)


def _step_bounded_meshes(monitor: Monitor) -> None:
    """Step two clouds that approach, with a bound on their impact. A small mesh may have a hull in its place."""
    cloud = Points(np.eye(3), 0.1)
    before = monitor.profile
    monitor.profile = before.replace(uncertainty=False, mesh_impact_tolerance=0.1)
    ids = np.array([OBJECTS + 1, OBJECTS + 2])
    for each in ids.tolist():
        monitor.add(each, cloud)
    twists = np.array([[0.0, 0, 0, 0, 0, 0], [-1.0, 0, 0, 0, 0, 0]])
    monitor.step(5_500_000_000, ids, np.array([[0, 500.0, 0, 0, 0, 0, 1], [2, 500.0, 0, 0, 0, 0, 1]]), twists)
    for each in ids.tolist():
        monitor.remove(each)
    monitor.profile = before


def _step_limited(monitor: Monitor, poses: Array, twists: Array, points: int) -> None:
    """Step with a limit on the pairs, and with contacts of up to `points` points."""
    for step, pairs in enumerate((1, 1, 1_000_000)):  # the last step has time for the pairs that the others deferred
        monitor.profile = monitor.profile.replace(pairs_per_step=pairs, contact_points=points)
        monitor.step(6_000_000_000 + step * 10_000_000, np.arange(2, OBJECTS), poses, twists)


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
    from collision_monitor.query.conflicts.conflicts import conflicts
    from collision_monitor.query.contact.contact import contact
    from collision_monitor.query.contact.contacts import contacts
    from collision_monitor.query.contact.overlap import overlap
    from collision_monitor.query.impact.contact_intervals import impacts
    from collision_monitor.query.impact.feature_impact import vertex_face_impact
    from collision_monitor.query.impact.time_of_impact import time_of_impact
    from collision_monitor.query.impact.times_of_impact import times_of_impact
    from collision_monitor.query.points.containment import contains
    from collision_monitor.query.points.points_within import points_within

    box, ball = Box((1, 1, 1)), Sphere(0.5)
    for threads in sorted({1, default_threads()}):
        shapes: list[Shape] = [box, ball] * WORTH_THREADS
        positions = np.arange(3.0 * len(shapes)).reshape(-1, 3)
        Detector(shapes, threads=threads).detect(positions, np.tile([0.0, 0.0, 0.0, 1.0], (len(shapes), 1)))
    contact(box, Pose(), ball, Pose()).points_a  # noqa: B018 - it is computed when it is read
    overlap(box, Pose(), ball, Pose())
    points_within(Points(np.eye(3)), Pose(), ball, Pose())
    time_of_impact(box, Motion(Pose(), angular=(0, 0, 1)), ball, Motion(Pose((3, 0, 0)), acceleration=(-1, 0, 0)))
    time_of_impact(box, Motion(Pose()), box, Motion(Pose((1, 0, 0))))  # they touch
    turns = Motion(Pose((3, 0, 0)), (-1, 0, 0), (0, 0, 1), frame="body")
    impacts(box, Motion(Pose()), ball, turns)
    turns.at(1.0)
    impacts(box, Trajectory([0, 1], [(0, 0, 0), (5, 0, 0)]), ball, turns)
    conflicts([box, ball], [Trajectory([0, 1], [(0, 0, 0), (5, 0, 0)]), turns])
    poses = np.array([[0.0, 0, 0, 0, 0, 0, 1], [1.0, 0, 0, 0, 0, 0, 1]])
    contacts(box, poses, ball, poses)
    times_of_impact(box, poses, np.zeros((2, 6)), ball, poses, np.zeros((2, 6)))
    vertex_face_impact(np.arange(24.0).reshape(8, 3))
    corners = np.vstack([np.zeros(3), np.eye(3)])
    faces = np.array([[0, 2, 1], [0, 1, 3], [1, 2, 3], [0, 3, 2]])
    apart = Mesh(np.vstack([corners, corners + 2.0]), np.vstack([faces, faces + 4]))  # is concave: it gets a tree
    contains(apart, Pose(), np.full((2, 3), 0.1), test="ray")
    for place in (Pose((0.2, 0.2, 0.2)), Pose((1.0, 0.0, 0.0)), Pose((5.0, 0.0, 0.0))):
        for other in (box, ball, apart):
            contact(apart, Pose(), other, place)
            time_of_impact(apart, Motion(Pose()), other, Motion(place, (-1, 0, 0)))


PARTS: Final = {
    "monitor": lambda: warm_up_monitor(CERTAIN),
    "options": warm_up_monitor,
    "functions": warm_up_functions,
}


if __name__ == "__main__":
    for part in sys.argv[1:] or PARTS:
        PARTS[part]()
