"""The tree of tf frames with its history: pose and twist of one frame in another at a stamp.

Between two samples a frame moves with a constant twist in its own axes, a screw motion, which is exact for a robot
that drives and turns steadily. Source: Lynch and Park, Modern Robotics (2017), 3.3.
"""

from __future__ import annotations

from bisect import bisect_left
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from collision_monitor.shapes.pose import from_rotation_vector, multiply, rotation_matrix
from collision_monitor.tolerances import LARGEST_INPUT

Floats = NDArray[np.float64]

HISTORY: Final = 10_000_000_000
"""ns of samples that are kept, as in tf2."""

MOST_SAMPLES: Final = 4096
"""Samples of one frame."""

MOST_SAMPLES_IN_ALL: Final = 400_000
"""Samples of a tree, 0.3 kB each. With more than 100 frames, each may have fewer than MOST_SAMPLES."""

MOST_FRAMES: Final = 10_000
"""Frames of a tree. A robot has 100. Those without a sample for HISTORY make room for new ones."""

MOST_LINKS_BETWEEN: Final = 256
"""Links from a frame to the root of its tree, 0.2 ms each. A robot has 30; tf2 allows 1000."""

LOOK_PERIOD: Final = 100_000_000
"""ns of stamps between two looks for frames without a sample, while there is no room for new ones."""

LONGEST_FRAME_NAME: Final = 256
"""Characters of a name of a frame."""

SQUARED_NORM: Final = 0.01
"""Largest difference from 1 of the squared norm of a quaternion of tf, as in tf2."""

_SHOWN: Final = 12
"""Frames that a text names."""

_NANOSECOND: Final = 1e-9


@dataclass(frozen=True, eq=False)
class FrameMotion:
    """Pose and twist of frame B in frame A.

    position (3,) in m, quaternion (4,), linear (3,) in m/s of B's origin and angular (3,) in rad/s, in A.
    twist_known: False if a frame between them has one sample only. moving: False if all links are static.
    """

    position: Floats
    quaternion: Floats
    linear: Floats
    angular: Floats
    twist_known: bool = True
    moving: bool = False

    def __matmul__(self, other: FrameMotion) -> FrameMotion:
        """Return the motion of C in A from those of B in A and of C in B."""
        R_AB = rotation_matrix(self.quaternion)
        arm = R_AB @ other.position
        return FrameMotion(
            self.position + arm,
            multiply(self.quaternion, other.quaternion),
            self.linear + np.cross(self.angular, arm) + R_AB @ other.linear,
            self.angular + R_AB @ other.angular,
            self.twist_known and other.twist_known,
            self.moving or other.moving,
        )

    def inverse(self) -> FrameMotion:
        """Return the motion of A in B."""
        back = self.quaternion * (-1.0, -1.0, -1.0, 1.0)
        R_BA = rotation_matrix(back)
        linear = R_BA @ (np.cross(self.angular, self.position) - self.linear)
        return FrameMotion(-R_BA @ self.position, back, linear, -R_BA @ self.angular, self.twist_known, self.moving)


AT_REST: Final = np.zeros(3)
IDENTITY: Final = FrameMotion(np.zeros(3), np.array([0.0, 0.0, 0.0, 1.0]), AT_REST, AT_REST)


@dataclass(frozen=True)
class MissingFrame:
    """Why there is no transform, for people."""

    text: str

    def __str__(self) -> str:
        return self.text


def frame_name(name: str) -> str:
    """Return the tf2 name of a frame. tf's names may begin with a slash."""
    return name.removeprefix("/")


def checked_poses(poses: Floats) -> list[tuple[Floats, Floats] | None]:
    """Return position and unit quaternion of poses (N, 7); None for those that are no poses.

    As in tf2, the quaternion may have a squared norm of 1 up to SQUARED_NORM.
    """
    position, quaternion = np.ascontiguousarray(poses[:, :3]), np.ascontiguousarray(poses[:, 3:])
    with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
        squared = (quaternion**2).sum(1)
        usable = (np.abs(position) <= LARGEST_INPUT).all(1) & (np.abs(squared - 1.0) <= SQUARED_NORM)
        unit = quaternion / np.sqrt(squared)[:, None]
    return [(position[k], unit[k]) if good else None for k, good in enumerate(usable.tolist())]


class _Link:
    """The samples of a frame in its parent, oldest first: stamps, and positions with quaternions."""

    __slots__ = ("parent", "poses", "stamps", "static")

    def __init__(self, parent: str, static: bool) -> None:
        self.parent = parent
        self.static = static
        self.stamps: list[int] = []
        self.poses: list[tuple[Floats, Floats]] = []

    def put(self, stamp_ns: int, pose: tuple[Floats, Floats], most: int) -> bool:
        """Add a sample in its place. Return whether it is within the history."""
        stamps = self.stamps
        if not stamps or stamp_ns > stamps[-1]:
            stamps.append(stamp_ns)
            self.poses.append(pose)
        elif stamp_ns < stamps[-1] - HISTORY:
            return False
        else:
            k = bisect_left(stamps, stamp_ns)
            if stamps[k] == stamp_ns:  # sent again, or corrected
                self.poses[k] = pose
                return True
            stamps.insert(k, stamp_ns)
            self.poses.insert(k, pose)
        old = max(bisect_left(stamps, stamps[-1] - HISTORY), len(stamps) - most)
        if old > 0:
            del stamps[:old], self.poses[:old]
        return True


class FrameTree:
    """Frames and the links between them. max_age: s beyond the last sample up to which a frame counts as known."""

    def __init__(self, max_age: float) -> None:
        self._links: dict[str, _Link] = {}
        self._max_age = round(max_age / _NANOSECOND)
        self._next_look = 0  # ns: before that, no frame is without a sample for HISTORY
        self._answers: dict[tuple[str, str, int], FrameMotion | MissingFrame] = {}  # until the tree changes

    @property
    def names(self) -> list[str]:
        """Names of all frames that were mentioned."""
        return sorted({*self._links, *(link.parent for link in self._links.values())})

    @property
    def some_names(self) -> str:
        """The first of these names, for texts."""
        names = self.names
        more = f" and {len(names) - _SHOWN} more" if len(names) > _SHOWN else ""
        return ", ".join(f"{name:.80}" for name in names[:_SHOWN]) + more or "none"

    def put(
        self, parent: str, child: str, position: Floats, quaternion: Floats, stamp_ns: int, *, static: bool
    ) -> str | None:
        """Add the pose of a frame in its parent at a stamp. Return the reason if it cannot be used."""
        (pose,) = checked_poses(np.concatenate([position, quaternion])[None])
        return self.put_checked(parent, child, pose, stamp_ns, static=static)

    def put_checked(
        self, parent: str, child: str, pose: tuple[Floats, Floats] | None, stamp_ns: int, *, static: bool
    ) -> str | None:
        """Add a pose of `checked_poses`. Return the reason if it cannot be used."""
        if pose is None:
            what = f"transform from {parent!r:.80} to {child!r:.80}"
            return f"{what}: expected finite numbers and a unit quaternion"
        if parent == child:
            return f"transform from {parent!r:.80} to itself"
        if len(parent) > LONGEST_FRAME_NAME or len(child) > LONGEST_FRAME_NAME:
            return f"transform to {child!r:.80}: expected names of at most {LONGEST_FRAME_NAME} characters"
        if self._answers:
            self._answers.clear()
        link = self._links.get(child)
        if link is None and len(self._links) >= MOST_FRAMES and not self._forget_silent(stamp_ns):
            return f"transform to {child!r:.80}: expected at most {MOST_FRAMES} frames"
        if link is None or static or link.parent != parent or link.static:
            link = self._links[child] = _Link(parent, static)
        most = min(MOST_SAMPLES, max(2, MOST_SAMPLES_IN_ALL // len(self._links)))
        if not link.put(stamp_ns, pose, most):
            return f"transform to {child!r:.80}: it is older than the last one by more than {HISTORY * 1e-9:g} s"
        return None

    def _forget_silent(self, now_ns: int) -> bool:
        """Forget the moving frames that have no sample within the history; return whether there were some."""
        if now_ns <= self._next_look:  # a look takes a millisecond, and a message may hold 10,000 new frames
            return False
        last = {frame: link.stamps[-1] for frame, link in self._links.items() if not link.static}
        silent = [frame for frame, stamp in last.items() if stamp < now_ns - HISTORY]
        for frame in silent:
            del self._links[frame], last[frame]
        self._next_look = max(min(last.values(), default=now_ns) + HISTORY, now_ns + LOOK_PERIOD)
        return bool(silent)

    def motion(self, target: str, source: str, stamp_ns: int) -> FrameMotion | MissingFrame:
        """Return the motion of `source` in `target` at a stamp, or why it is not known."""
        if target == source:
            return IDENTITY
        if max(len(target), len(source)) > LONGEST_FRAME_NAME:  # it has no transform, and no answer keeps its name
            return self._motion(target, source, stamp_ns)
        key = target, source, stamp_ns
        found = self._answers.get(key)
        if found is None:
            if len(self._answers) >= MOST_SAMPLES:
                self._answers.clear()
            found = self._answers[key] = self._motion(target, source, stamp_ns)
        return found

    def _motion(self, target: str, source: str, stamp_ns: int) -> FrameMotion | MissingFrame:
        upward, downward = self._chain(source), self._chain(target)
        common = next((frame for frame in upward if frame in downward), None)
        if common is None:
            if max(len(upward), len(downward)) > MOST_LINKS_BETWEEN:
                text = f"expected at most {MOST_LINKS_BETWEEN} transforms between {target!r:.80} and {source!r:.80}"
                return MissingFrame(f"{text}, got more")
            return MissingFrame(
                f"no transform from {target!r:.80} to {source!r:.80}; frames known from tf: {self.some_names}"
            )
        down = self._motion_in(common, target, stamp_ns)
        if isinstance(down, MissingFrame):
            return down
        up = self._motion_in(common, source, stamp_ns)
        return up if isinstance(up, MissingFrame) else down.inverse() @ up

    def nearest_moving(self, frame: str) -> str | None:
        """Return the frame itself, or the first above it, whose link to its parent is not static."""
        return next((each for each in self._chain(frame) if each in self._links and not self._links[each].static), None)

    def restart(self) -> None:
        """Forget all samples that are not static."""
        self._links = {frame: link for frame, link in self._links.items() if link.static}
        self._next_look = 0
        self._answers.clear()

    def _chain(self, frame: str) -> dict[str, None]:
        """Return the frame and all above it, in this order. A loop is walked once, and a longer way than any is cut."""
        chain = {frame: None}
        while (link := self._links.get(frame)) is not None and link.parent not in chain:
            frame = link.parent
            chain[frame] = None
            if len(chain) > MOST_LINKS_BETWEEN:
                break
        return chain

    def _motion_in(self, ancestor: str, frame: str, stamp_ns: int) -> FrameMotion | MissingFrame:
        motion = IDENTITY
        while frame != ancestor:
            link = self._links[frame]
            step = self._sample(frame, link, stamp_ns)
            if isinstance(step, MissingFrame):
                return step
            motion = step @ motion
            frame = link.parent
        return motion

    def _sample(self, frame: str, link: _Link, stamp_ns: int) -> FrameMotion | MissingFrame:
        """Return the motion of a frame in its parent at a stamp."""
        stamps, poses = link.stamps, link.poses
        if link.static:
            return FrameMotion(*poses[-1], AT_REST, AT_REST)
        if not stamps[0] - self._max_age <= stamp_ns <= stamps[-1] + self._max_age:
            side = "older" if stamp_ns > stamps[-1] else "newer"
            return MissingFrame(
                f"the transform from {link.parent!r:.80} to {frame!r:.80} is {side} than the message by more than "
                f"max_age, {self._max_age * _NANOSECOND:g} s"
            )
        if len(stamps) == 1:
            return FrameMotion(*poses[-1], AT_REST, AT_REST, twist_known=False, moving=True)
        k = min(max(bisect_left(stamps, stamp_ns), 1), len(stamps) - 1)
        return _screw((stamps[k - 1], *poses[k - 1]), (stamps[k], *poses[k]), stamp_ns)


def _screw(a: tuple[int, Floats, Floats], b: tuple[int, Floats, Floats], stamp_ns: int) -> FrameMotion:
    """Return the motion at a stamp along the screw through two samples, also before and behind them.

    At the second one the pose is that sample, to its last bit.
    """
    elapsed, since = (b[0] - a[0]) * _NANOSECOND, (stamp_ns - b[0]) * _NANOSECOND
    turn = multiply(a[2] * (-1.0, -1.0, -1.0, 1.0), b[2])
    turn = turn if turn[3] >= 0.0 else -turn
    sine = float(np.sqrt(turn[:3] @ turn[:3]))
    angle = 2.0 * float(np.arctan2(sine, turn[3]))
    angular = turn[:3] * (angle / (sine * elapsed) if sine > 0.0 else 2.0 / elapsed)  # in the frame's own axes, rad/s
    shift = rotation_matrix(a[2]).T @ (b[1] - a[1])
    linear = np.linalg.solve(_mean_rotation(angular, elapsed), shift) / elapsed
    position = b[1] + rotation_matrix(b[2]) @ (_mean_rotation(angular, since) @ (linear * since))
    quaternion = multiply(b[2], from_rotation_vector(angular * since))
    R = rotation_matrix(quaternion)
    return FrameMotion(position, quaternion, R @ linear, R @ angular, moving=True)


def _mean_rotation(angular: Floats, time: float) -> Floats:
    """Return the mean (3, 3) of the rotations from 0 to `time` at a constant angular velocity."""
    phi = angular * time
    angle = float(np.sqrt(phi @ phi))
    K: Floats = np.array([[0.0, -phi[2], phi[1]], [phi[2], 0.0, -phi[0]], [-phi[1], phi[0], 0.0]])
    if angle < 1e-4:  # below, the series is exact to 1e-18
        return np.asarray(np.eye(3) + (0.5 - angle**2 / 24.0) * K + (1.0 / 6.0 - angle**2 / 120.0) * K @ K)
    return np.asarray(np.eye(3) + (1.0 - np.cos(angle)) / angle**2 * K + (angle - np.sin(angle)) / angle**3 * K @ K)
