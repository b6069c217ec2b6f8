"""Poses and quaternion functions.

Quaternions are (x, y, z, w), as in ROS. A rotation matrix R_WA takes vectors of frame A to frame W.
"""

from __future__ import annotations

import contextlib
from collections.abc import Iterable
from functools import cached_property
from math import sqrt
from typing import Any, Final, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from collision_monitor.checks.numbers import real_array, real_number
from collision_monitor.errors import PoseError
from collision_monitor.shapes.matrix_to_pose import matrix_to_pose
from collision_monitor.shapes.shape import Shape
from collision_monitor.tolerances import LARGEST_INPUT, NORMALISED, UNIT_QUATERNION

Array = NDArray[np.float64]


def checked_vector(value: ArrayLike, name: str, length: int = 3) -> Array:
    """Check a vector of `length` finite numbers; return it as float64, read-only. Raises PoseError."""
    try:
        result = np.array(real_array(value))
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


def shortest_turns(before: Array, after: Array) -> tuple[Array, Array]:
    """The shortest rotations from quaternions (N, 4) to others, in world axes.

    Returns the vector parts of their quaternions (N, 3), and the factors (N,) that make them rotation vectors (rad).
    """
    turn = multiply(after, before * (-1.0, -1.0, -1.0, 1.0))
    turn *= np.where(turn[:, 3:] < 0.0, -1.0, 1.0)
    sine = np.sqrt((turn[:, :3] ** 2).sum(1))
    return turn[:, :3], np.where(sine > 0.0, 2.0 * np.arctan2(sine, turn[:, 3]) / np.where(sine > 0.0, sine, 1.0), 2.0)


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


def _plain(value: Any) -> Any:
    """Return a tuple or a list, whose numbers Python reads faster than those of an array. Raises TypeError."""
    kind = type(value)
    if kind is tuple or kind is list:
        return value
    if kind is np.ndarray:
        return real_array(value).tolist()
    raise TypeError


def three_numbers(value: Any) -> tuple[float, float, float]:
    """Return three finite numbers. Raises one of REFUSED for anything else."""
    x, y, z = _plain(value)
    if not (type(x) is float and type(y) is float and type(z) is float):
        x, y, z = real_number(x), real_number(y), real_number(z)
    if (
        -LARGEST_INPUT <= x <= LARGEST_INPUT
        and -LARGEST_INPUT <= y <= LARGEST_INPUT
        and -LARGEST_INPUT <= z <= LARGEST_INPUT
    ):
        return x, y, z
    raise ValueError


REFUSED: Final = (TypeError, ValueError, OverflowError)
"""What `three_numbers` raises."""


def _matrix_error(X: Array) -> PoseError:
    """What is wrong with a matrix (4, 4) or (3, 3)."""
    if len(X) == 4 and (last := X[3].tolist()) != [0.0, 0.0, 0.0, 1.0]:
        return PoseError(f"matrix: expected the last row 0 0 0 1, got {last}")
    if len(X) == 4 and not (np.abs(X[:3, 3]) <= LARGEST_INPUT).all():
        return PoseError(f"matrix: expected a finite position up to {LARGEST_INPUT:g}, got {X[:3, 3].tolist()}")
    return PoseError(f"matrix: expected a rotation (orthonormal, determinant 1), got {X[:3, :3].tolist()}")


class Frozen:
    """Base of the values that never change: their attributes are set once, in their own dictionary."""

    def __setattr__(self, name: str, value: Any) -> None:
        raise AttributeError(f"{type(self).__name__} never changes: make another one in place of setting {name}")

    def __delattr__(self, name: str) -> None:
        raise AttributeError(f"{type(self).__name__} never changes: its {name} stays")


class Pose(Frozen):
    """Pose of a body: position (m) and orientation (unit quaternion x, y, z, w). Raises PoseError.

    position (3,), quaternion (4,) and rotation (3, 3) are read-only arrays; numbers has x, y, z, qx, qy, qz, qw.

    >>> (Pose((1, 0, 0)) @ Pose((0, 2, 0))).position
    array([1., 2., 0.])
    """

    numbers: tuple[float, ...]
    position: Array
    quaternion: Array

    def __init__(self, position: Any = (0.0, 0.0, 0.0), quaternion: Any = (0.0, 0.0, 0.0, 1.0), *others: Any) -> None:
        if others:  # three numbers in place of a position
            raise PoseError(
                f"Pose: expected a position and a quaternion, got {2 + len(others)} arguments; write Pose((x, y, z))"
            )
        try:
            at = three_numbers(position)
            x, y, z, w = _plain(quaternion)
            if not (type(x) is float and type(y) is float and type(z) is float and type(w) is float):
                x, y, z, w = real_number(x), real_number(y), real_number(z), real_number(w)
        except REFUSED:
            at = tuple(checked_vector(position, "position").tolist())
            x, y, z, w = checked_vector(quaternion, "quaternion", 4).tolist()
        norm = sqrt(x * x + y * y + z * z + w * w)
        if abs(norm - 1.0) <= NORMALISED:  # to normalise it again would change its last bit
            self.__dict__["numbers"] = (*at, x, y, z, w)
        elif abs(norm - 1.0) <= UNIT_QUATERNION:
            self.__dict__["numbers"] = (*at, x / norm, y / norm, z / norm, w / norm)
        else:
            checked_vector((x, y, z, w), "quaternion", 4)
            raise PoseError(
                f"quaternion: expected x, y, z, w of unit length within {UNIT_QUATERNION:g}, "
                f"got {[x, y, z, w]} of length {norm:g}"
            )

    @classmethod
    def of_numbers(cls, numbers: Iterable[float]) -> Self:
        """Pose of x, y, z and a unit quaternion x, y, z, w to the bit: to normalise it again could change it."""
        made = cls.__new__(cls)
        made.__dict__["numbers"] = tuple(numbers)
        return made

    def __getattr__(self, name: str) -> Any:
        """Make an array when it is first read: a query reads the numbers alone."""
        if name == "position":
            value = np.array(self.numbers[:3])
        elif name == "quaternion":
            value = np.array(self.numbers[3:])
        else:
            raise AttributeError(f"{type(self).__name__!r} object has no attribute {name!r}", name=name, obj=self)
        value.setflags(write=False)
        self.__dict__[name] = value
        return value

    def __repr__(self) -> str:
        """Return the numbers for a person."""
        x, y, z, *q = self.numbers
        turned = "" if q == [0.0, 0.0, 0.0, 1.0] else f", quaternion=({', '.join(f'{each:.6g}' for each in q)})"
        return f"{type(self).__name__}(({x:.6g}, {y:.6g}, {z:.6g}){turned})"

    def __reduce__(self) -> tuple[Any, ...]:
        """Copies and pickles hold the numbers alone."""
        return type(self).of_numbers, (self.numbers,)

    @classmethod
    def from_matrix(cls, matrix: ArrayLike) -> Self:
        """Pose of a homogeneous matrix (4, 4), or of a rotation matrix (3, 3) at the origin. Raises PoseError.

        >>> Pose.from_matrix([[0, -1, 0, 1], [1, 0, 0, 2], [0, 0, 1, 3], [0, 0, 0, 1]]).position
        array([1., 2., 3.])
        """
        try:
            X = np.array(real_array(matrix), order="C")
        except (TypeError, ValueError, OverflowError):
            raise PoseError(f"matrix: expected numbers (4, 4) or (3, 3), got {matrix!r}") from None
        if X.shape not in ((4, 4), (3, 3)):
            raise PoseError(f"matrix: expected shape (4, 4) or (3, 3), got {X.shape}")
        off, numbers = matrix_to_pose.entry(X)
        if not off <= UNIT_QUATERNION:
            raise _matrix_error(X)
        return cls.of_numbers(numbers)

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


def as_pose(value: Any, name: str) -> Pose:
    """Return a pose, also of a position (3,), of x y z qx qy qz qw (7,), or of a matrix (4, 4). Raises PoseError.

    name: of the argument, for the error.
    """
    if isinstance(value, Pose):
        return value
    shape: tuple[int, ...] = ()
    if isinstance(value, np.ndarray):
        shape = value.shape
        if shape == (7,) and type(value) is np.ndarray and value.dtype == np.float64:
            value = value.tolist()  # Python reads its parts faster
    elif isinstance(value, tuple | list):
        with contextlib.suppress(ValueError):  # rows of different lengths
            shape = np.shape(value) if len(value) == 4 else (len(value),)
    try:
        if shape == (3,):
            return Pose(value)
        if shape == (7,):
            return Pose(value[:3], value[3:])
        if shape == (4, 4):
            return Pose.from_matrix(value)
    except PoseError as error:
        raise PoseError(f"{name}: {error}") from None
    got = f"an array of shape {shape}" if shape else type(value).__name__
    if isinstance(value, Shape):
        got += "; each shape is followed by its pose: shape_a, pose_a, shape_b, pose_b"
    raise PoseError(f"{name}: expected a Pose, (x, y, z), 7 numbers x y z qx qy qz qw or a matrix (4, 4), got {got}")
