"""trajectory_msgs/JointTrajectory and moveit_msgs/DisplayTrajectory as the motion of a robot's joints."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from collision_monitor.errors import InputError
from collision_monitor.motion.trajectory import Tolerance
from collision_monitor.robots.joint_motion import JointMotion
from collision_monitor.robots.joint_trajectory import MOST_JOINT_POINTS, joint_trajectory
from collision_monitor.robots.kinematic_tree import KinematicTree

Floats = NDArray[np.float64]

JOINT_TRAJECTORY: Final = "trajectory_msgs/msg/JointTrajectory"
DISPLAY_TRAJECTORY: Final = "moveit_msgs/msg/DisplayTrajectory"

MOST_PARTS: Final = 100
"""Trajectories of a DisplayTrajectory that follow each other."""

TIMES: Final = 41
"""Times of the plan, around now, among which the one is searched at which the joints are."""

_SECOND: Final = 1_000_000_000


@dataclass(frozen=True, eq=False)
class JointPlan:
    """The motion of all joints of a robot. zero_ns: stamp of its time 0."""

    zero_ns: int
    motion: JointMotion

    def at(self, now_ns: int) -> JointMotion:
        """The motion with times from now on (s)."""
        return JointMotion(self.motion.edges - (now_ns - self.zero_ns) / _SECOND, self.motion.coefficients)

    def is_over(self, now_ns: int, late: float) -> bool:
        """Whether its end is longer ago than `late` (s)."""
        return (now_ns - self.zero_ns) / _SECOND > float(self.motion.edges[-1]) + late

    def off(self, now_ns: int, joints: Floats, tolerance: Tolerance) -> Floats:
        """How far (J,) each joint is off the plan (rad or m), at the time within the tolerance at which that is least.

        joints (J, 2): positions and rates.
        """
        now = (now_ns - self.zero_ns) / _SECOND
        found = self.motion.at(now + np.linspace(-tolerance.time, tolerance.time, TIMES))[:, :, 0]
        off = np.abs(found - joints[:, 0])
        return np.asarray(off[int(off.sum(axis=1).argmin())])


def joint_plan(message: Any, tree: KinematicTree, joints: Floats, now_ns: int) -> JointPlan | None:
    """Return the plan of a message that arrived now; None for one without points, which ends the plan.

    joints (J, 2): positions and rates of all joints now. A header's stamp is the time at which the trajectory starts;
    0: now. The trajectories of a DisplayTrajectory follow each other, from now on. Raises InputError.
    """
    found: JointMotion | None = None
    for each in _trajectories(message):
        if not len(each.points):
            continue
        if found is None:
            found = _motion(each, tree, joints, _begin(each, now_ns))
        else:
            end = found.at(found.edges[-1:])[0] * (1.0, 0.0)  # it rests there
            found = _joined(found, _motion(each, tree, end, 0.0))
    return None if found is None else JointPlan(now_ns, found)


def _trajectories(message: Any) -> Iterator[Any]:
    """The JointTrajectory messages in one. Raises InputError."""
    if hasattr(message, "joint_names"):
        yield message
        return
    if len(message.trajectory) > MOST_PARTS:
        raise InputError(f"trajectory: expected at most {MOST_PARTS}, got {len(message.trajectory)}")
    for each in message.trajectory:
        if len(each.multi_dof_joint_trajectory.points):
            raise InputError("trajectory: expected joints with one axis each, got a multi_dof_joint_trajectory")
        yield each.joint_trajectory


def _begin(message: Any, now_ns: int) -> float:
    """Time (s) from now to time 0 of a trajectory."""
    stamp = int(message.header.stamp.sec) * _SECOND + int(message.header.stamp.nanosec)
    return (stamp - now_ns) / _SECOND if stamp else 0.0


def _motion(message: Any, tree: KinematicTree, start: Floats, begin: float) -> JointMotion:
    """The motion of one JointTrajectory from now on, whose time 0 is at `begin` (s). Raises InputError."""
    names, points = list(message.joint_names), message.points
    if len(points) > MOST_JOINT_POINTS:
        raise InputError(f"points: expected at most {MOST_JOINT_POINTS}, got {len(points)}")
    times = [begin + it.time_from_start.sec + 1e-9 * it.time_from_start.nanosec for it in points]
    rows: list[Floats | None] = []
    for what in ("positions", "velocities", "accelerations"):
        given = [getattr(it, what) for it in points]
        lengths = {len(each) for each in given}
        if lengths == {0}:
            rows.append(None)
            continue
        if lengths != {len(names)}:
            text = ", ".join(map(str, sorted(lengths)[:5]))
            raise InputError(
                f"{what}: expected one for each of {len(names)} joints at all points, or none, got {text:.100}"
            )
        rows.append(np.array(given, np.float64))
    return joint_trajectory(tree, names, times, rows, start)


def _joined(first: JointMotion, then: JointMotion) -> JointMotion:
    """Two motions, of which the second one begins, at its time 0, when the first one ends."""
    count = max(first.coefficients.shape[2], then.coefficients.shape[2])
    filled = [np.pad(it.coefficients, ((0, 0), (0, 0), (0, count - it.coefficients.shape[2]))) for it in (first, then)]
    return JointMotion(np.append(first.edges, first.edges[-1] + then.edges[1:]), np.concatenate(filled))
