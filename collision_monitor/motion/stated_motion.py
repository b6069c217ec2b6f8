"""Motions as a caller states them: a pose, velocities and an acceleration, along the world's axes or the body's."""

from __future__ import annotations

from math import inf
from typing import Any, Final, Literal

import numpy as np
from numpy.typing import NDArray

from collision_monitor._jit import allocating_kernel, kernel
from collision_monitor.errors import PoseError
from collision_monitor.geometry.vector import Vector, rotate
from collision_monitor.motion.course import ARC, STRAIGHT, course_of, place_on, turned_for
from collision_monitor.motion.motion import quaternion_to_matrix
from collision_monitor.shapes.pose import (
    REFUSED,
    Frozen,
    Pose,
    as_pose,
    checked_vector,
    from_rotation_vector,
    multiply,
    three_numbers,
)

Array = NDArray[np.float64]
Frame = Literal["world", "body"]

LINEAR, ANGULAR, ACCELERATION, COURSE, REST, NUMBERS = 7, 10, 13, 16, 17, 18
"""Columns of the numbers of a motion: a pose, then linear and angular velocity, acceleration, the kind of its Course
and the time (s) from which on it stands. NUMBERS: their count."""

_FOREVER: Final = (float(STRAIGHT), inf)


class Motion(Frozen):
    """A pose, its twist and its linear acceleration. Raises PoseError.

    linear (m/s) and acceleration (m/s^2) refer to the body's origin; angular is in rad/s. The pose may be given as
    `as_pose` takes it. frame: "world", the vectors are along the world's axes and stay so; or "body", they are along
    the body's own axes and stay so, as the twist of nav_msgs/Odometry: a body that drives and turns goes along an arc,
    where an acceleration counts as far as it is along the velocity. stops: an acceleration against the velocity ends
    when the body stands; without it the body then goes backwards. The arrays (3,) are read-only, along the world's
    axes; numbers has them one after the other, then the kind of the Course and the time from which on the body stands.

    >>> Motion(Pose(), linear=(1, 0, 0), angular=(0, 0, 0.5)).at(2.0).position
    array([2., 0., 0.])
    >>> Motion(Pose(), linear=(1, 0, 0), angular=(0, 0, 0.5), frame="body").at(2.0).position.round(3)
    array([1.683, 0.919, 0.   ])
    >>> Motion(Pose(), linear=(2, 0, 0), acceleration=(-1, 0, 0), stops=True).at(9.0).position
    array([2., 0., 0.])
    """

    pose: Pose
    numbers: tuple[float, ...]
    linear: Array
    angular: Array
    acceleration: Array

    def __init__(
        self,
        pose: Any,
        linear: Any = (0.0, 0.0, 0.0),
        angular: Any = (0.0, 0.0, 0.0),
        acceleration: Any = (0.0, 0.0, 0.0),
        frame: Frame = "world",
        stops: bool = False,
    ) -> None:
        known = self.__dict__
        known["pose"] = pose if type(pose) is Pose else as_pose(pose, "Motion, pose")
        try:
            numbers = (*three_numbers(linear), *three_numbers(angular), *three_numbers(acceleration))
        except REFUSED:
            named = {"linear velocity": linear, "angular velocity": angular, "acceleration": acceleration}
            numbers = tuple(number for name, value in named.items() for number in checked_vector(value, name).tolist())
        known["numbers"] = numbers + _FOREVER
        if stops or frame != "world":
            rows = np.array([[*known["pose"].numbers, *known["numbers"]]])
            along_body = is_body_frame(frame)
            set_courses(rows, along_body, along_body, bool(stops))
            known["numbers"] = tuple(rows[0, LINEAR:].tolist())

    def __getattr__(self, name: str) -> Any:
        """Make an array when it is first read."""
        if name not in _PLACE:
            raise AttributeError(f"{type(self).__name__!r} object has no attribute {name!r}", name=name, obj=self)
        value = np.array(self.numbers[_PLACE[name]])
        value.setflags(write=False)
        self.__dict__[name] = value
        return value

    def __repr__(self) -> str:
        """Return the pose and what is not zero, for a person."""
        parts = [repr(self.pose)]
        for name, place in _PLACE.items():
            if any(self.numbers[place]):
                parts.append(f"{name}=({', '.join(f'{each:.6g}' for each in self.numbers[place])})")
        course, rest = self.numbers[-2:]
        parts += [_COURSES[int(course)]] if course else []
        parts += [f"stands from {rest:.6g} s on"] if rest < inf else []
        return f"{type(self).__name__}({', '.join(parts)})"

    def __reduce__(self) -> tuple[Any, ...]:
        """Copies and pickles hold the pose and the numbers alone."""
        return _of_numbers, (self.pose, self.numbers)

    @property
    def is_straight(self) -> bool:
        """Whether the body goes straight, with a constant acceleration, for ever."""
        return self.numbers[-2] == STRAIGHT

    def at(self, time: float) -> Pose:
        """The pose after `time` seconds on this course."""
        if self.is_straight:
            turn = from_rotation_vector(self.angular * time)
            moved = (self.linear + 0.5 * self.acceleration * time) * time
        else:
            out = np.empty(4)
            _place_after(np.array(self.numbers), float(time), out)
            moved, turn = out[:3], from_rotation_vector(self.angular * out[3])
        return Pose(self.pose.position + moved, multiply(turn, self.pose.quaternion))


_PLACE: Final = {"linear": slice(0, 3), "angular": slice(3, 6), "acceleration": slice(6, 9)}

_COURSES: Final = ("straight", "straight until it stands", "along an arc")


def _of_numbers(pose: Pose, numbers: tuple[float, ...]) -> Motion:
    """Make the motion that has these numbers."""
    made = object.__new__(Motion)
    made.__dict__.update(pose=pose, numbers=numbers)
    return made


def motion_of(pose: Pose, row: Array) -> Motion:
    """The motion from a pose on with the other numbers of a row (NUMBERS,)."""
    return _of_numbers(pose, tuple(row[LINEAR:].tolist()))


def is_body_frame(frame: Any) -> bool:
    """Whether velocities are along the body's axes. Raises PoseError for a frame that is neither world nor body."""
    if frame not in ("world", "body"):
        raise PoseError(f"frame: expected 'world' or 'body', got {frame!r}")
    return bool(frame == "body")


@allocating_kernel
def set_courses(numbers: Any, along_body: bool, turns: bool, stops: bool) -> None:
    """Set the courses of motions (N, NUMBERS), in place.

    along_body: their vectors are along the bodies' axes, and are turned to the world's. turns: the velocities turn with
    the bodies. stops: an acceleration against the velocity ends at rest.
    """
    R = np.empty((3, 3))
    for k in range(len(numbers)):
        row = numbers[k]
        v, w = (row[7], row[8], row[9]), (row[10], row[11], row[12])
        a = (row[13], row[14], row[15])
        if along_body:
            quaternion_to_matrix(numbers[:, 3:7], k, R)
            v, w, a = rotate(R, v), rotate(R, w), rotate(R, a)
        course = course_of(v, w, a, turns, stops)
        for c in range(3):
            row[LINEAR + c], row[ANGULAR + c], row[ACCELERATION + c] = v[c], w[c], course.acceleration[c]
        row[COURSE], row[REST] = course.kind, course.rest


@kernel
def _place_after(numbers: Any, t: float, out: Any) -> None:
    """Write the displacement (m) of a motion's numbers after t (s), and for how long it has turned (s), to out (4,)."""
    v: Vector = (numbers[0], numbers[1], numbers[2])
    w: Vector = (numbers[3], numbers[4], numbers[5])
    a: Vector = (numbers[6], numbers[7], numbers[8])
    kind, rest = int(numbers[9]), numbers[10]
    out[0], out[1], out[2] = place_on(kind, v, w, a, t, rest).moved
    out[3] = turned_for(kind, v, a, t, rest)


def straight_motions(states: Array) -> Array:
    """Numbers of motions (N, NUMBERS) of poses and twists (N, 13) along the world's axes, without acceleration."""
    rows = np.zeros((len(states), NUMBERS))
    rows[:, :ACCELERATION], rows[:, COURSE:] = states, _FOREVER
    return rows


def flat_motion(motion: Motion, pose: Pose) -> Motion:
    """The motion from a pose in the x-y plane on, without what leads out of the plane."""
    v, w, a = motion.linear, motion.angular, motion.acceleration
    rows = np.array([[*pose.numbers, v[0], v[1], 0.0, 0.0, 0.0, w[2], a[0], a[1], 0.0, *_FOREVER]])
    course, rest = motion.numbers[-2:]
    set_courses(rows, False, course == ARC, rest < inf)
    return _of_numbers(pose, tuple(rows[0, LINEAR:].tolist()))
