"""The tree of tf frames with its history: pose and twist of one frame in another at a stamp.

Between two samples a frame moves with a constant twist in its own axes, a screw motion, which is exact for a robot
that drives and turns steadily. Source: Lynch and Park, Modern Robotics (2017), 3.3.
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from collision_monitor.shapes.pose import from_rotation_vector, multiply, rotation_matrix
from collision_monitor.tolerances import LARGEST_INPUT, UNIT_QUATERNION

Floats = NDArray[np.float64]

HISTORY: Final = 10_000_000_000
"""ns of samples that are kept, as in tf2."""

MOST_SAMPLES: Final = 4096
"""Samples of one frame."""

MOST_FRAMES: Final = 10_000
"""Frames of a tree. A robot has 100."""

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


class _Link:
    """The samples of a frame in its parent, oldest first."""

    def __init__(self, parent: str, static: bool) -> None:
        self.parent = parent
        self.static = static
        self.samples: deque[tuple[int, Floats, Floats]] = deque(maxlen=MOST_SAMPLES)  # stamp, position, quaternion


class FrameTree:
    """Frames and the links between them. max_age: s beyond the last sample up to which a frame counts as known."""

    def __init__(self, max_age: float) -> None:
        self._links: dict[str, _Link] = {}
        self._max_age = round(max_age / _NANOSECOND)

    @property
    def names(self) -> list[str]:
        """Names of all frames that were mentioned."""
        return sorted({*self._links, *(link.parent for link in self._links.values())})

    def put(
        self, parent: str, child: str, position: Floats, quaternion: Floats, stamp_ns: int, *, static: bool
    ) -> str | None:
        """Add the pose of a frame in its parent at a stamp. Return the reason if it cannot be used."""
        usable = np.abs(position).max() <= LARGEST_INPUT and np.abs(quaternion).max() <= 2.0  # False for NaN
        length = float(np.sqrt(quaternion @ quaternion)) if usable else 0.0
        if abs(length - 1.0) > UNIT_QUATERNION:
            return f"transform from {parent!r} to {child!r}: expected finite numbers and a unit quaternion"
        if parent == child:
            return f"transform from {parent!r} to itself"
        link = self._links.get(child)
        if link is None and len(self._links) >= MOST_FRAMES:
            return f"transform to {child!r}: expected at most {MOST_FRAMES} frames"
        if link is None or link.parent != parent or link.static != static or static:
            link = self._links[child] = _Link(parent, static)
        samples = link.samples
        if samples and stamp_ns <= samples[-1][0]:
            if stamp_ns == samples[-1][0]:  # sent again, or corrected
                samples.pop()
            else:
                return None  # late: history stays in order
        samples.append((stamp_ns, position, quaternion / length))
        while samples[-1][0] - samples[0][0] > HISTORY:
            samples.popleft()
        return None

    def motion(self, target: str, source: str, stamp_ns: int) -> FrameMotion | MissingFrame:
        """Return the motion of `source` in `target` at a stamp, or why it is not known."""
        if target == source:
            return IDENTITY
        upward, downward = self._chain(source), self._chain(target)
        common = next((frame for frame in upward if frame in downward), None)
        if common is None:
            known = ", ".join(self.names) or "none"
            return MissingFrame(f"no transform from {target!r} to {source!r}; frames known from tf: {known}")
        down = self._motion_in(common, target, stamp_ns)
        up = self._motion_in(common, source, stamp_ns)
        if isinstance(up, MissingFrame):
            return up
        if isinstance(down, MissingFrame):
            return down
        return down.inverse() @ up

    def nearest_moving(self, frame: str) -> str | None:
        """Return the frame itself, or the first above it, whose link to its parent is not static."""
        return next((each for each in self._chain(frame) if each in self._links and not self._links[each].static), None)

    def restart(self) -> None:
        """Forget all samples that are not static."""
        self._links = {frame: link for frame, link in self._links.items() if link.static}

    def _chain(self, frame: str) -> list[str]:
        """Return the frame and all above it. A loop is walked once."""
        chain = [frame]
        while (link := self._links.get(chain[-1])) is not None and link.parent not in chain:
            chain.append(link.parent)
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
        samples = link.samples
        last, first = samples[-1], samples[0]
        if link.static:
            return FrameMotion(last[1], last[2], AT_REST, AT_REST)
        if not first[0] - self._max_age <= stamp_ns <= last[0] + self._max_age:
            side = "older" if stamp_ns > last[0] else "newer"
            return MissingFrame(
                f"the transform from {link.parent!r} to {frame!r} is {side} than the message by more than max_age, "
                f"{self._max_age * _NANOSECOND:g} s"
            )
        if len(samples) == 1:
            return FrameMotion(last[1], last[2], AT_REST, AT_REST, twist_known=False, moving=True)
        k = len(samples) - 1
        while k > 1 and samples[k - 1][0] >= stamp_ns:
            k -= 1
        return _screw(samples[k - 1], samples[k], stamp_ns)


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
