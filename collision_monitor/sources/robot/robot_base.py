"""Where the base link of a robot is: bolted at a pose, at a frame of tf, or at odometry."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Final, NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from collision_monitor.robots.robot import Robot
from collision_monitor.shapes.pose import Pose, from_rotation_vector, multiply
from collision_monitor.sources.ground.covariances import usable_blocks
from collision_monitor.sources.ground.frames import IDENTITY, FrameMotion, frame_name
from collision_monitor.sources.ground.scene_states import empty_states, turn_twists
from collision_monitor.sources.ground.source_scene import SourceScene
from collision_monitor.sources.messages.poses import ODOMETRY, put_pose, worst_stddev
from collision_monitor.sources.messages.transform_arrays import TRANSFORMS
from collision_monitor.sources.robot.robot_entry import RobotEntry
from collision_monitor.tolerances import LARGEST_INPUT

Floats = NDArray[np.float64]

_EXACT: Final = np.zeros(4)


class BaseMotion(NamedTuple):
    """Motion of the base link in the monitor's frame.

    stddev (4,): of its position (m), orientation (rad), linear (m/s) and angular velocity (rad/s).
    """

    motion: FrameMotion
    stddev: Floats = _EXACT

    @property
    def row(self) -> Floats:
        """Position, quaternion, linear and angular velocity, (13,)."""
        m = self.motion
        return np.concatenate([m.position, m.quaternion, m.linear, m.angular])


class RobotBase(Protocol):
    """topics: those that `take` wants. fresh: whether there is news since the last `motion`."""

    topics: Mapping[str, tuple[str, ...]]
    fresh: bool

    def take(self, content: Any, stamp_ns: int, robot: Robot, scene: SourceScene) -> None:
        """Process a decoded message."""

    def moved_by(self, robot: Robot, scene: SourceScene) -> str | None:
        """Return the frame whose transforms move the base; None if there is none."""

    def restart(self) -> None:
        """Forget all earlier times."""

    def motion(self, now_ns: int, robot: Robot, scene: SourceScene) -> BaseMotion | None:
        """Return the motion of the base link; None, after a refusal, if it is not known."""


def robot_base(entry: RobotEntry, frame: str, max_age: float) -> RobotBase:
    """Return the base of an entry of the file. frame: the monitor's."""
    base = entry.base
    if base.odometry:
        return OdometryBase(entry, max_age)
    if base.pose is not None and base.frame in ("", frame):
        return FixedBase(base.pose)
    return FrameBase(entry)


class FixedBase:
    """The base link stands at a pose in the monitor's frame."""

    def __init__(self, pose: Pose) -> None:
        self.topics: Mapping[str, tuple[str, ...]] = {}
        self.fresh = True
        self._motion = BaseMotion(_at_rest(pose))

    def take(self, content: Any, stamp_ns: int, robot: Robot, scene: SourceScene) -> None:
        """See RobotBase."""

    def moved_by(self, robot: Robot, scene: SourceScene) -> str | None:
        """See RobotBase."""
        return None

    def restart(self) -> None:
        """See RobotBase."""

    def motion(self, now_ns: int, robot: Robot, scene: SourceScene) -> BaseMotion:
        """See RobotBase."""
        self.fresh = False
        return self._motion


class FrameBase:
    """A link is at a frame of tf: the link with the frame's name, or the base link if no link has it."""

    def __init__(self, entry: RobotEntry) -> None:
        self.topics: Mapping[str, tuple[str, ...]] = {"/tf": (TRANSFORMS,)}
        self.fresh = True
        self._entry = entry

    def take(self, content: Any, stamp_ns: int, robot: Robot, scene: SourceScene) -> None:
        """See RobotBase. The feed has put the transforms into the tree."""
        self.fresh = True

    def moved_by(self, robot: Robot, scene: SourceScene) -> str | None:
        """See RobotBase."""
        return scene.frames.nearest_moving(self.frame(robot))

    def restart(self) -> None:
        """See RobotBase."""
        self.fresh = True

    def frame(self, robot: Robot) -> str:
        """Return the frame of tf that the base is at."""
        return self._entry.base.frame or self._entry.base.link or robot.tree.links[0]

    def motion(self, now_ns: int, robot: Robot, scene: SourceScene) -> BaseMotion | None:
        """See RobotBase."""
        name, base = self._entry.name, self._entry.base
        frame = self.frame(robot)
        found = scene.locate(name, frame, now_ns)
        link = base.link or (frame if frame in robot.tree.links else robot.tree.links[0])
        back = _base_in_link(robot, link, f"{name}, base", scene)
        if found is None or back is None:
            return None
        self.fresh = False
        at = IDENTITY if base.pose is None else _at_rest(base.pose)
        moved = BaseMotion(found @ at @ back)
        return moved if _is_near(moved, name, scene) else None


class OdometryBase:
    """A link moves as nav_msgs/Odometry says: `link` of the entry, or else the message's child_frame_id."""

    def __init__(self, entry: RobotEntry, max_age: float) -> None:
        self.topics: Mapping[str, tuple[str, ...]] = {entry.base.odometry: (ODOMETRY,)}
        self.fresh = False
        self._entry = entry
        self._max_age = round(max_age * 1e9)
        self._last: BaseMotion | None = None
        self._stamp = 0

    def take(self, content: Any, stamp_ns: int, robot: Robot, scene: SourceScene) -> None:
        """See RobotBase."""
        name = self._entry.name
        frame = scene.locate(name, frame_name(content.header.frame_id), stamp_ns)
        link = self._entry.base.link or frame_name(content.child_frame_id)
        back = _base_in_link(robot, link, f"{name}, base", scene)
        if frame is None or back is None:
            return
        states, twist = empty_states([0]), content.twist.twist
        put_pose(states, content.pose.pose)
        states["linear"] = twist.linear.x, twist.linear.y, twist.linear.z
        states["angular"] = twist.angular.x, twist.angular.y, twist.angular.z
        numbers = np.concatenate([states[0][field] for field in ("position", "quaternion", "linear", "angular")])
        if not (np.abs(numbers) <= LARGEST_INPUT).all() or abs(float(np.linalg.norm(numbers[3:7])) - 1.0) > 1e-3:
            scene.refuse(name, "base: expected finite numbers and a unit quaternion in the odometry")
            return
        states["quaternion"] /= np.linalg.norm(states["quaternion"])
        turn_twists(states)
        state = states[0]
        moved = FrameMotion(state["position"], state["quaternion"], state["linear"], state["angular"], moving=True)
        base = BaseMotion(frame @ moved @ back, _stddev(content, name, scene))
        if not _is_near(base, name, scene) or (self._last is not None and stamp_ns < self._stamp):
            return  # late, if it is before the last one: a time that goes back begins with `restart`
        self._last = base
        self._stamp, self.fresh = stamp_ns, True

    def moved_by(self, robot: Robot, scene: SourceScene) -> str | None:
        """See RobotBase."""
        return None

    def restart(self) -> None:
        """See RobotBase."""
        self._last, self.fresh = None, False

    def motion(self, now_ns: int, robot: Robot, scene: SourceScene) -> BaseMotion | None:
        """See RobotBase. The base moves on at its twist since the message."""
        self.fresh = False
        age = now_ns - self._stamp
        if self._last is None or abs(age) > self._max_age:
            reason = "none came" if self._last is None else f"the last one is {age * 1e-9:.3f} s old"
            scene.refuse(self._entry.name, f"base: expected odometry on {self._entry.base.odometry}, but {reason}")
            return None
        return _advanced(self._last, age * 1e-9)


def _base_in_link(robot: Robot, link: str, what: str, scene: SourceScene) -> FrameMotion | None:
    """Return the pose of the base link in a link that is rigid with it; None, after a refusal, for other links."""
    if link not in robot.tree.links:
        scene.refuse(what, f"expected the pose of a link of the robot, got {link!r:.80}; name it with `link: …`")
        return None
    row = robot.tree.links.index(link)
    if robot.tree.needs[row].any():
        scene.refuse(what, f"expected a link that is rigid with {robot.tree.links[0]}, got {link}")
        return None
    if row == 0:
        return IDENTITY
    poses, _ = robot.states(np.zeros((len(robot.tree.joints), 2)), np.eye(1, 13, 6)[0])
    return _at_rest(Pose(poses[row, :3], poses[row, 3:])).inverse()


def _is_near(base: BaseMotion, name: str, scene: SourceScene) -> bool:
    """Return whether all numbers are finite and small enough for the monitor, else refuse the motion."""
    if (np.abs(base.row) <= LARGEST_INPUT).all():
        return True
    scene.refuse(name, f"base: expected finite numbers up to {LARGEST_INPUT:g}, got NaN, infinity or larger")
    return False


def _at_rest(pose: Pose) -> FrameMotion:
    return FrameMotion(pose.position, pose.quaternion, np.zeros(3), np.zeros(3))


def _advanced(base: BaseMotion, elapsed: float) -> BaseMotion:
    """Return a base after `elapsed` s at its twist, and its wider uncertainty."""
    if elapsed == 0.0:
        return base
    m = base.motion
    position = m.position + m.linear * elapsed
    quaternion = multiply(from_rotation_vector(m.angular * elapsed), m.quaternion)
    stddev = base.stddev.copy()
    stddev[:2] = np.hypot(stddev[:2], stddev[2:] * elapsed)
    moved = FrameMotion(position, quaternion, m.linear, m.angular, m.twist_known, m.moving)
    return BaseMotion(moved, stddev)


def _stddev(odometry: Any, name: str, scene: SourceScene) -> Floats:
    """Return standard deviations (4,) along the worst axes from the covariances of a message; 0 where it has none."""
    found = []
    for part in (odometry.pose, odometry.twist):
        blocks = usable_blocks(np.asarray(part.covariance, np.float64).reshape(1, 36))
        if not blocks.valid[0]:
            scene.refuse(name, "base: expected symmetric covariances without negative eigenvalues; one was ignored")
        found.append((np.nan_to_num(worst_stddev(blocks.linear))[0], blocks.stddev[0]))
    (position, orientation), (velocity, turning) = found
    return np.array([position, orientation, velocity, turning])


def at_links(base: BaseMotion, arms: Floats) -> Floats:
    """Return standard deviations (N, 4) of points that the base carries. arms (N, 3): from its origin, m."""
    lengths = np.sqrt((arms**2).sum(axis=1))
    position, orientation, velocity, turning = base.stddev
    result = np.empty((len(arms), 4))
    result[:, 0], result[:, 1] = np.hypot(position, orientation * lengths), orientation
    result[:, 2], result[:, 3] = np.hypot(velocity, turning * lengths), turning
    return result
