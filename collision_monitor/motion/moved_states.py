"""States at a later time, moved along their courses: for what is late, and what is drawn between two states."""

from __future__ import annotations

from typing import Any, Final

import numpy as np
from numpy.typing import ArrayLike, NDArray

from collision_monitor._jit import allocating_kernel
from collision_monitor.geometry.vector import rotate, rotate_back, scaled
from collision_monitor.motion.course import STRAIGHT, course_of, turned_for
from collision_monitor.motion.motion import quaternion_to_matrix, turn_quaternion, twist_on
from collision_monitor.records import StateFlag
from collision_monitor.shapes.pose import rotation_matrix

States = Any  # (N,) records.STATE; NumPy's stubs know no assignment to its fields

_VALID: Final = int(StateFlag.ACCELERATION_VALID)
_BODY: Final = int(StateFlag.BODY_TWIST)
_STOPS: Final = int(StateFlag.STOPS)

_VECTORS: Final = ("linear", "angular", "acceleration")


def moved_states(states: States, seconds: ArrayLike) -> States:
    """Return copies of states (N,) after `seconds` (N,) on their courses; standard deviations and flags stay."""
    moved = np.ascontiguousarray(states).copy()
    numbers = moved.view(np.float64).reshape(len(moved), moved.dtype.itemsize // 8)
    after = np.ascontiguousarray(np.broadcast_to(np.asarray(seconds, np.float64), len(moved)))
    _move(numbers, np.ascontiguousarray(moved["flags"]), after)
    return moved


def in_world(states: States) -> States:
    """Return copies of states (N,) with all twists along the world's axes, and no BODY_TWIST."""
    turned = np.ascontiguousarray(states).copy()
    own = (turned["flags"] & np.uint32(_BODY)) != 0
    R = rotation_matrix(turned["quaternion"][own])
    for name in _VECTORS:
        turned[name][own] = (R @ turned[name][own][..., None])[..., 0]
    turned["flags"] &= ~np.uint32(_BODY)
    return turned


def along_body(states: States, which: NDArray[np.bool_]) -> None:
    """Turn the twists of some of the states (N,), along the world's axes, to the bodies' axes, and flag them so."""
    R = np.swapaxes(rotation_matrix(states["quaternion"][which]), -1, -2)
    for name in _VECTORS:
        states[name][which] = (R @ states[name][which][..., None])[..., 0]
    states["flags"][which] |= np.uint32(_BODY)


@allocating_kernel
def _move(numbers: Any, flags: Any, seconds: Any) -> None:
    """Move the rows of states (N, 21) along their courses. flags (N,), seconds (N,)."""
    R, q = np.empty((3, 3)), np.empty((1, 4))
    for k in range(len(numbers)):
        row, t = numbers[k], seconds[k]
        v, w, a = (row[7], row[8], row[9]), (row[10], row[11], row[12]), (0.0, 0.0, 0.0)
        if (flags[k] & _VALID) != 0:
            a = (row[13], row[14], row[15])
        turns = (flags[k] & _BODY) != 0
        quaternion_to_matrix(numbers[:, 3:7], k, R)
        if turns:
            v, w, a = rotate(R, v), rotate(R, w), rotate(R, a)
        course = course_of(v, w, a, turns, (flags[k] & _STOPS) != 0)
        kind, a, rest = course.kind, course.acceleration, course.rest
        there = twist_on(kind, v, w, a, t, rest)
        turn_quaternion(numbers[:, 3:7], k, w[0], w[1], w[2], turned_for(kind, v, a, t, rest), q[0])
        if kind != STRAIGHT:
            a = scaled(there.velocity, there.change)
        v, w = there.velocity, there.angular
        for c in range(3):
            row[c] += there.moved[c]
        for c in range(4):
            row[3 + c] = q[0, c]
        if turns:
            quaternion_to_matrix(q, 0, R)
            v, w, a = rotate_back(R, v), rotate_back(R, w), rotate_back(R, a)
        keeps = turns and kind == STRAIGHT  # an acceleration along the body's axes stays as it is there
        for c in range(3):
            row[7 + c], row[10 + c] = v[c], w[c]
            if (flags[k] & _VALID) != 0 and not keeps:
                row[13 + c] = a[c]
