"""A JointTrajectory as a plan of a gate, and as messages again, at another rate."""

from __future__ import annotations

from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

from collision_monitor.errors import InputError
from collision_monitor.motion.stated_motion import Motion
from collision_monitor.motion.trajectory import Trajectory
from collision_monitor.robots.joint_motion import JointMotion
from collision_monitor.robots.kinematic_tree import KinematicTree, with_fixed_rows
from collision_monitor.robots.link_motions import link_motions
from collision_monitor.robots.link_pieces import Wanted
from collision_monitor.robots.link_plans import link_plans
from collision_monitor.ros.gate.gated_plan import GatedPlan, RateChange
from collision_monitor.ros.gate.gated_world import GatedWorld
from collision_monitor.shapes.pose import Pose
from collision_monitor.sources.robot.joint_plan import joint_plan

Floats = NDArray[np.float64]

BEYOND: Final = 1e-3
"""rad or m by which a trajectory may leave the limits of the URDF: round-off of planners."""

FIRST: Final = 0.05
"""s from now to the first point of a trajectory at another rate, so that a controller has it in time."""

STEP: Final = 0.05
"""s between points of a trajectory at another rate while the rate changes. Longer: the cubics between them differ from
the plan by the fourth power."""

LEAST: Final = 1e-6
"""s of a plan between two points of a message."""

FINE: Final = 1000
"""Times among which the one is searched at which a plan ends while its rate changes."""

FIELDS: Final = 3
"""Fields of a point with positions, velocities and accelerations."""

BASE_STANDS: Final = 0.01
"""m/s, and rad/s: the base of an arm that moves no faster stands."""


class ArmSource(NamedTuple):
    """What a plan of an arm is made of. fields: 1 positions; 2 and velocities; 3 and accelerations. columns: joints."""

    motion: JointMotion
    names: tuple[str, ...]
    columns: tuple[int, ...]
    fields: int


class GatedArm:
    """A robot of a URDF, and where its objects are on it. carrier: link that carries objects that are no links."""

    def __init__(self, tree: KinematicTree, carrier: str) -> None:
        if carrier and carrier not in tree.links:
            raise InputError(f"parameter carrier: expected a link of the URDF, got {carrier!r}")
        self.tree, self._carrier = tree, carrier

    def plan(self, message: Any, joints: Floats, world: GatedWorld, now_ns: int, tolerance: float) -> GatedPlan:
        """Return the plan of a JointTrajectory. joints (J, 2): positions and rates now. Raises InputError.

        tolerance: rad or m by which a first point that is now may differ from the joints.
        """
        found = joint_plan(message, self.tree, joints, now_ns)
        if found is None:
            raise InputError("points: expected at least one, got none")
        motion = found.motion
        columns = tuple(self.tree.joints.index(name) for name in message.joint_names)
        self._check_limits(motion)
        off = np.abs(motion.at(np.zeros(1))[0, :, 0] - joints[:, 0])
        if off.max(initial=0.0) > tolerance:
            j = int(off.argmax())
            raise InputError(f"it starts elsewhere: {self.tree.joints[j]} is {off[j]:.3f} rad or m off its first point")
        if motion.edges[0] < 0.0:
            raise InputError(f"it started {-motion.edges[0]:.3f} s ago by the stamp of its header")
        first = message.points[0]
        fields = 1 + bool(len(first.velocities)) + bool(len(first.accelerations))
        source = ArmSource(motion, tuple(message.joint_names), columns, fields)
        return self._with_bodies(source, joints, world, now_ns)

    def _check_limits(self, motion: JointMotion) -> None:
        """Raise InputError for points beyond the limits of the URDF. A joint without limits has none."""
        points = motion.at(motion.edges)[:, :, 0]
        beyond = np.maximum(self.tree.limits[:, 0] - points, points - self.tree.limits[:, 1])
        if beyond.max(initial=-1.0) > BEYOND:
            k, j = np.unravel_index(int(beyond.argmax()), beyond.shape)
            low, high = self.tree.limits[j]
            raise InputError(
                f"positions: expected {low:g} to {high:g} for {self.tree.joints[j]}, the limits of the URDF, "
                f"got {points[k, j]:g}"
            )

    def _with_bodies(self, source: ArmSource, joints: Floats, world: GatedWorld, now_ns: int) -> GatedPlan:
        rows, offsets, own = [], [], world.own
        here = self.tree_poses(joints, np.eye(1, 13, 6)[0])
        base = self._base(here, world, now_ns)
        here = self.tree_poses(joints, np.array([*base.numbers, *np.zeros(6)]))
        for object_id, it in own.items():
            link = it.name.rpartition("/")[2]
            if link in self.tree.links:
                rows.append(self.tree.links.index(link))
                offsets.append(Pose())
                continue
            if not self._carrier:
                raise InputError(
                    f"{it.name!r} is no link of the URDF; name the link that carries it, such as -p carrier:=hand"
                )
            rows.append(self.tree.links.index(self._carrier))
            motion = world.motion(object_id, now_ns)
            if motion is None:
                raise InputError(f"expected a state of {it.name!r}, got none so far")
            offsets.append(Pose(here[rows[-1], :3], here[rows[-1], 3:]).inverse() @ motion.pose)
        grown = with_fixed_rows(self.tree, np.array(rows), np.array([each.numbers for each in offsets]))
        wanted = Wanted(len(self.tree.links) + np.arange(len(rows)), np.array([world.reaches[each] for each in own]))
        numbers = np.array([*base.numbers, *Motion(base).numbers])
        made = link_plans(grown, wanted, source.motion, numbers)
        bodies = {
            each: Trajectory(*made.points(k), between="arc", tube=float(made.pieces.tubes[k]))
            for k, each in enumerate(own)
        }
        return GatedPlan(bodies, float(source.motion.edges[-1]), {each: world.reaches[each] for each in own}, source)

    def tree_poses(self, joints: Floats, base: Floats) -> Floats:
        """Poses (L, 7) of all links. joints (J, 2); base (13,): as of `link_motions`."""
        poses, _ = link_motions(self.tree.table, joints[None], base[None])
        return np.asarray(poses[0])

    def _base(self, here: Floats, world: GatedWorld, now_ns: int) -> Pose:
        """Where the base link is, from the object of the link that fewest joints move. Raises InputError."""
        links = {it.name.rpartition("/")[2]: each for each, it in world.own.items()}
        known = [link for link in links if link in self.tree.links]
        if not known:
            raise InputError(
                f"expected objects of the robot that are links of the URDF, got {', '.join(sorted(links))[:200]}"
            )
        link = min(known, key=lambda name: int(self.tree.needs[self.tree.links.index(name)].sum()))
        row, motion = self.tree.links.index(link), world.motion(links[link], now_ns)
        if motion is None:
            raise InputError(f"expected a state of {world.described[links[link]].name!r}, got none so far")
        speed = max(np.linalg.norm(motion.linear), np.linalg.norm(motion.angular))
        if not self.tree.needs[row].any() and speed > BASE_STANDS:
            raise InputError(f"expected a base that stands while the arm moves, got one at {speed:.3f} m/s or rad/s")
        return motion.pose @ Pose(here[row, :3], here[row, 3:]).inverse()


def message_to_hold(source: ArmSource, joints: Floats, stop_time: float) -> JointTrajectory:
    """Return a JointTrajectory that lets the joints (J, 2), positions and rates now, come to a stop in `stop_time` (s).

    Controllers do not agree on what a message without points means.
    """
    there = np.stack([joints[:, 0] + 0.5 * stop_time * joints[:, 1], np.zeros(len(joints))], axis=1)
    return _message(source, np.array([stop_time]), there[None], np.zeros(1))


def message_at(source: ArmSource, change: RateChange) -> JointTrajectory:
    """Return what is left of a plan as a JointTrajectory that starts now, at a rate that changes.

    Its points have positions, and velocities if those of the plan have them.
    """
    motion = source.motion
    end = float(motion.edges[-1]) if change.target > 0.0 else min(change.end, float(motion.edges[-1]))
    seconds = np.arange(FIRST, change.duration + FIRST, STEP)
    seconds = np.append(seconds[seconds < change.duration], max(change.duration, FIRST))
    times = change.plan_time(seconds)
    if change.target > 0.0 and times[-1] < end:
        later = motion.edges if source.fields < FIELDS else np.arange(times[-1], end, STEP)
        later = np.append(later[(later > times[-1] + LEAST) & (later < end - LEAST)], end)
        seconds = np.append(seconds, seconds[-1] + (later - times[-1]) / change.target)
        times = np.append(times, later)
    if times[-1] > end + LEAST:  # it comes to the end while the rate still changes
        fine = np.linspace(0.0, seconds[-1], FINE)
        last = max(FIRST, float(np.interp(end, change.plan_time(fine), fine)))
        kept = (times < end - LEAST) & (seconds < last)
        seconds, times = np.append(seconds[kept], last), np.append(times[kept], end)
    rates = change.rate_at(seconds)
    return _message(source, seconds, motion.at(times), rates)


def _message(source: ArmSource, seconds: Floats, joints: Floats, rates: Floats) -> JointTrajectory:
    message = JointTrajectory(joint_names=list(source.names))
    chosen = joints[:, list(source.columns)]
    for t, row, rate in zip(seconds.tolist(), chosen, rates.tolist(), strict=True):
        point = JointTrajectoryPoint(positions=row[:, 0].tolist())
        if source.fields > 1:
            point.velocities = (row[:, 1] * rate).tolist()
        point.time_from_start.sec, nanoseconds = divmod(round(t * 1e9), 1_000_000_000)
        point.time_from_start.nanosec = nanoseconds
        message.points.append(point)
    return message
