"""Poses, motions and quaternion functions.

Quaternions are (x, y, z, w), as in ROS. A rotation matrix R_WA takes vectors of frame A to frame W.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from collision_monitor.errors import PoseError
from collision_monitor.tolerances import LARGEST_INPUT, UNIT_QUATERNION

Array = NDArray[np.float64]


def checked_vector(value: ArrayLike, name: str, length: int = 3) -> Array:
    """Check a vector of `length` finite numbers; return it as float64, read-only. Raises PoseError."""
    try:
        result = np.array(value, dtype=np.float64)
    except (TypeError, ValueError, OverflowError):
        raise PoseError(f"{name}: expected {length} numbers, got {value!r}") from None
    if result.shape != (length,):
        raise PoseError(f"{name}: expected {length} numbers, got an array of shape {result.shape}"
                        + _advice(result.shape))  # fmt: skip
    if not (np.abs(result) <= LARGEST_INPUT).all():
        raise PoseError(f"{name}: expected finite numbers up to {LARGEST_INPUT:g}, got {result.tolist()}")
    result.setflags(write=False)
    return result


def _advice(shape: tuple[int, ...]) -> str:
    matrix = "; of a matrix write Pose.from_matrix(matrix)"
    angles = "; of angles write Pose.from_euler(roll, pitch, yaw)"
    return {(4, 4): matrix, (3, 3): matrix, (3,): angles}.get(shape, "")


def unit_quaternion(value: ArrayLike) -> Array:
    """Normalise a quaternion (x, y, z, w) within 1e-3 of unit length. Raises PoseError beyond."""
    q = checked_vector(value, "quaternion", 4)
    norm = float(np.linalg.norm(q))
    if abs(norm - 1.0) > UNIT_QUATERNION:
        raise PoseError(
            f"quaternion: expected x, y, z, w of unit length within {UNIT_QUATERNION:g}, "
            f"got {q.tolist()} of length {norm:g}"
        )
    q = q / norm
    q.setflags(write=False)
    return q


def multiply(a: ArrayLike, b: ArrayLike) -> Array:
    """Hamilton product of quaternions (..., 4): the rotation b, then a."""
    ax, ay, az, aw = np.moveaxis(np.asarray(a, dtype=np.float64), -1, 0)
    bx, by, bz, bw = np.moveaxis(np.asarray(b, dtype=np.float64), -1, 0)
    return np.stack(
        [
            aw * bx + ax * bw + ay * bz - az * by,
            aw * by - ax * bz + ay * bw + az * bx,
            aw * bz + ax * by - ay * bx + az * bw,
            aw * bw - ax * bx - ay * by - az * bz,
        ],
        axis=-1,
    )


def from_rotation_vector(rotation: ArrayLike) -> Array:
    """Quaternions (..., 4) of rotation vectors (..., 3): axis times angle in rad."""
    rotation = np.asarray(rotation, dtype=np.float64)
    angle = np.linalg.norm(rotation, axis=-1, keepdims=True)
    return np.concatenate([np.sinc(angle / (2 * np.pi)) * rotation / 2, np.cos(angle / 2)], axis=-1)


def rotation_matrix(quaternion: ArrayLike) -> Array:
    """Rotation matrices (..., 3, 3) of unit quaternions (..., 4)."""
    q = np.asarray(quaternion, dtype=np.float64)
    x, y, z, w = q.tolist() if q.ndim == 1 else np.moveaxis(q, -1, 0)  # Python's numbers are faster than NumPy's
    rows = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
    ]
    return np.array(rows) if q.ndim == 1 else np.ascontiguousarray(np.moveaxis(np.array(rows), (0, 1), (-2, -1)))


@dataclass(frozen=True, eq=False)
class Pose:
    """Pose of a body: position (m) and orientation (unit quaternion x, y, z, w). Raises PoseError.

    >>> (Pose((1, 0, 0)) @ Pose((0, 2, 0))).position
    array([1., 2., 0.])
    """

    position: Any = (0.0, 0.0, 0.0)
    quaternion: Any = (0.0, 0.0, 0.0, 1.0)

    def __new__(cls, *args: Any, **kwargs: Any) -> Self:
        """Refuse three numbers in place of a position."""
        if len(args) > 2:
            raise PoseError(f"Pose: expected a position and a quaternion, got {len(args)} arguments; "
                            "write Pose((x, y, z))")  # fmt: skip
        return super().__new__(cls)

    def __post_init__(self) -> None:
        object.__setattr__(self, "position", checked_vector(self.position, "position"))
        object.__setattr__(self, "quaternion", unit_quaternion(self.quaternion))

    @classmethod
    def from_matrix(cls, matrix: ArrayLike) -> Self:
        """Pose of a homogeneous matrix (4, 4), or of a rotation matrix (3, 3) at the origin. Raises PoseError.

        >>> Pose.from_matrix([[0, -1, 0, 1], [1, 0, 0, 2], [0, 0, 1, 3], [0, 0, 0, 1]]).position
        array([1., 2., 3.])
        """
        try:
            X = np.array(matrix, dtype=np.float64)
        except (TypeError, ValueError, OverflowError):
            raise PoseError(f"matrix: expected numbers (4, 4) or (3, 3), got {matrix!r}") from None
        if X.shape not in ((4, 4), (3, 3)):
            raise PoseError(f"matrix: expected shape (4, 4) or (3, 3), got {X.shape}")
        if X.shape == (4, 4) and (X[3] != (0.0, 0.0, 0.0, 1.0)).any():
            raise PoseError(f"matrix: expected the last row 0 0 0 1, got {X[3].tolist()}")
        R, position = X[:3, :3], X[:3, 3] if X.shape == (4, 4) else (0.0, 0.0, 0.0)
        if not np.abs(R @ R.T - np.eye(3)).max() <= UNIT_QUATERNION or not np.linalg.det(R) > 0.0:
            raise PoseError(f"matrix: expected a rotation (orthonormal, determinant 1), got {R.tolist()}")
        # the largest of 4 w^2, 4 x^2, 4 y^2, 4 z^2 loses no digits (Shepperd, 1978)
        K = np.array(
            [
                [1 + R[0, 0] - R[1, 1] - R[2, 2], R[0, 1] + R[1, 0], R[0, 2] + R[2, 0], R[2, 1] - R[1, 2]],
                [R[0, 1] + R[1, 0], 1 - R[0, 0] + R[1, 1] - R[2, 2], R[1, 2] + R[2, 1], R[0, 2] - R[2, 0]],
                [R[0, 2] + R[2, 0], R[1, 2] + R[2, 1], 1 - R[0, 0] - R[1, 1] + R[2, 2], R[1, 0] - R[0, 1]],
                [R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1], 1 + R[0, 0] + R[1, 1] + R[2, 2]],
            ]
        )
        q = K[K.diagonal().argmax()]
        return cls(position, q / np.linalg.norm(q))

    @classmethod
    def from_euler(
        cls, roll: float, pitch: float, yaw: float, position: ArrayLike = (0.0, 0.0, 0.0), *, degrees: bool = False
    ) -> Self:
        """Pose turned about the fixed axes x, then y, then z, as in URDF and tf2; rad, or degrees. Raises PoseError.

        >>> Pose.from_euler(0, 0, 90, degrees=True).rotation.round(3)[:, 0]
        array([0., 1., 0.])
        """
        angles = checked_vector((roll, pitch, yaw), "roll, pitch, yaw")
        x, y, z = from_rotation_vector(np.diag(np.radians(angles) if degrees else angles))
        return cls(position, multiply(z, multiply(y, x)))

    @classmethod
    def from_wxyz(cls, position: ArrayLike, quaternion: ArrayLike) -> Self:
        """Pose with a quaternion w, x, y, z, the order of Eigen's constructor, MuJoCo and Drake. Raises PoseError.

        >>> Pose.from_wxyz((1, 2, 3), (1, 0, 0, 0)).quaternion
        array([0., 0., 0., 1.])
        """
        w, x, y, z = checked_vector(quaternion, "quaternion w, x, y, z", 4)
        return cls(position, (x, y, z, w))

    @property
    def matrix(self) -> Array:
        """X_WA (4, 4): takes homogeneous points of the body to the world."""
        X = np.eye(4)
        X[:3, :3], X[:3, 3] = self.rotation, self.position
        return X

    def inverse(self) -> Pose:
        """X_AW of this X_WA.

        >>> (Pose((1, 2, 3)) @ Pose((1, 2, 3)).inverse()).position
        array([0., 0., 0.])
        """
        back = self.quaternion * (-1.0, -1.0, -1.0, 1.0)
        return Pose(-self.rotation.T @ self.position, back)

    @cached_property
    def rotation(self) -> Array:
        """R_WA (3, 3), read-only; takes the body's vectors to the world frame."""
        matrix = rotation_matrix(self.quaternion)
        matrix.setflags(write=False)
        return matrix

    def __matmul__(self, other: Pose) -> Pose:
        """X_WB = X_WA @ X_AB."""
        return Pose(self.position + self.rotation @ other.position, multiply(self.quaternion, other.quaternion))


@dataclass(frozen=True, eq=False)
class Motion:
    """A pose, its twist and its linear acceleration, in the world frame. Raises PoseError.

    linear (m/s) and acceleration (m/s^2) refer to the body's origin; angular is in rad/s.

    >>> Motion(Pose(), linear=(1, 0, 0), angular=(0, 0, 0.5)).at(2.0).position
    array([2., 0., 0.])
    """

    pose: Pose
    linear: Any = (0.0, 0.0, 0.0)
    angular: Any = (0.0, 0.0, 0.0)
    acceleration: Any = (0.0, 0.0, 0.0)

    def __post_init__(self) -> None:
        if not isinstance(self.pose, Pose):
            got = type(self.pose).__name__
            raise PoseError(f"Motion: expected a Pose first, got {got}; write Motion(Pose((x, y, z)), linear)")
        object.__setattr__(self, "linear", checked_vector(self.linear, "linear velocity"))
        object.__setattr__(self, "angular", checked_vector(self.angular, "angular velocity"))
        object.__setattr__(self, "acceleration", checked_vector(self.acceleration, "acceleration"))

    def at(self, time: float) -> Pose:
        """The pose after `time` seconds at constant angular velocity and acceleration."""
        turn = from_rotation_vector(self.angular * time)
        moved = (self.linear + 0.5 * self.acceleration * time) * time
        return Pose(self.pose.position + moved, multiply(turn, self.pose.quaternion))
