"""Joint trajectories: points with positions, velocities and accelerations, as polynomials between two points.

As ros2_control's joint_trajectory_controller follows them: linear with positions alone, cubic with velocities too, and
quintic with accelerations too.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from collision_monitor.checks.numbers import as_numbers
from collision_monitor.errors import InputError
from collision_monitor.motion.trajectory import FASTEST
from collision_monitor.robots.joint_motion import JointMotion
from collision_monitor.robots.kinematic_tree import KinematicTree
from collision_monitor.tolerances import LARGEST_INPUT

Floats = NDArray[np.float64]

MOST_JOINT_POINTS: Final = 10_000
"""Points of a joint trajectory: 100 s at 100 Hz."""

LONGEST_PLAN: Final = 3600.0
"""s from now to the end of a joint trajectory."""

SHORTEST_STEP: Final = 1e-6
"""s between two points. Less: the fifth derivative overflows. Such points have a wrong unit."""

_CUBIC: Final = np.array([[-3.0, 3.0, -2.0, -1.0], [2.0, -2.0, 1.0, 1.0]])
"""Coefficients of the second and third power for p0, p1, v0 h, v1 h."""

_QUINTIC: Final = np.array(
    [[-10.0, 10.0, -6.0, -4.0, -1.5, 0.5], [15.0, -15.0, 8.0, 7.0, 1.5, -1.0], [-6.0, 6.0, -3.0, -3.0, -0.5, 0.5]]
)
"""Those of the third to the fifth power for p0, p1, v0 h, v1 h, a0 h^2, a1 h^2."""

_SHOWN: Final = 5


def joint_trajectory(
    tree: KinematicTree, names: Sequence[str], times: Any, points: Sequence[Any], start: Floats, joins: bool = True
) -> JointMotion:
    """Return the motion of all joints (J) of a tree along a trajectory of some of them.

    names (K): the joints of the trajectory. times (N,): s from now on, rising. points: positions (N, K) in rad or m;
    then velocities and accelerations (N, K), or None. start (J, 2): positions and velocities of all joints now; joints
    without a trajectory rest there. joins: whether the motion goes from there to a first point in the future, or rests
    at that point until then. A continuous joint turns to its first point the short way. Raises InputError.
    """
    given = list(names)
    columns = _columns(tree, given)
    seconds = _times(times)
    rows = [_rows(each, what, len(seconds), given) for each, what in zip(points, _WHATS, strict=True)]
    if rows[0] is None:
        raise InputError("positions: expected one for each point and joint, got none")
    if rows[2] is not None and rows[1] is None:
        raise InputError("accelerations: expected velocities too, got none")
    state = [each for each in rows if each is not None]
    now = start[columns]
    turn = np.where(tree.wraps[columns], 2.0 * np.pi * np.round((now[:, 0] - state[0][0]) / (2.0 * np.pi)), 0.0)
    state[0] = state[0] + turn
    if joins and seconds[0] > 0.0:
        seconds = np.append(0.0, seconds)
        first = [now[:, 0], now[:, 1], np.zeros(len(columns))]
        state = [np.concatenate([one[None], each]) for one, each in zip(first, state, strict=False)]
    if len(seconds) < 2 or seconds[-1] <= 0.0:
        raise InputError("times: expected a point in the future, got one that is now or over")
    moving = _polynomials(np.diff(seconds), state)
    _check_speed(np.diff(seconds), moving, given)
    coefficients = np.zeros((len(seconds) - 1, len(tree.joints), moving.shape[2]))
    coefficients[:, :, 0] = start[:, 0]
    coefficients[:, columns] = moving
    return JointMotion(seconds, coefficients)


_WHATS: Final = ("positions", "velocities", "accelerations")


def numbers_by_joint(names: Sequence[str], given: Any, what: str) -> Floats:
    """Return a number (J,) for each joint, from a table by their names or from numbers in their order.

    what: the argument's name, for the InputError.
    """
    if isinstance(given, Mapping):
        unknown, missing = given.keys() - set(names), [name for name in names if name not in given]
        if unknown or missing:
            found = f"unknown: {', '.join(sorted(map(repr, unknown)))}" if unknown else f"none for {', '.join(missing)}"
            raise InputError(f"{what}: expected a number for each of {', '.join(names)}, got {found:.300}")
        given = [given[name] for name in names]
    numbers = as_numbers(given, what, f"{len(names)} numbers")
    if numbers.shape != (len(names),):
        raise InputError(
            f"{what}: expected shape ({len(names)},), one for each of {', '.join(names)}, got {numbers.shape}"
        )
    bad = np.flatnonzero(~(np.abs(numbers) <= LARGEST_INPUT))
    if len(bad):
        j = int(bad[0])
        raise InputError(f"{what}: expected finite numbers up to {LARGEST_INPUT:g}, got {numbers[j]:g} for {names[j]}")
    return numbers


def _columns(tree: KinematicTree, names: list[str]) -> NDArray[np.intp]:
    place = {name: j for j, name in enumerate(tree.joints)}
    unknown = [name for name in names if name not in place]
    if unknown:
        more = f" and {len(unknown) - _SHOWN} more" if len(unknown) > _SHOWN else ""
        raise InputError(
            f"joint names: expected joints of the robot that move by themselves ({', '.join(tree.joints)}), "
            f"got {', '.join(f'{name!r:.80}' for name in unknown[:_SHOWN])}{more}"
        )
    if not names or len(set(names)) < len(names):
        twice = next((name for name in names if names.count(name) > 1), None)
        raise InputError(
            f"joint names: expected each joint once, got {'none' if twice is None else f'{twice!r} twice'}"
        )
    return np.array([place[name] for name in names], np.intp)


def _times(times: Any) -> Floats:
    found = np.array(as_numbers(times, "times", "numbers (N,)"))
    if found.ndim != 1 or not 1 <= len(found) <= MOST_JOINT_POINTS:
        raise InputError(f"times: expected 1 to {MOST_JOINT_POINTS} numbers (N,), got shape {found.shape}")
    if not (np.abs(found) <= LONGEST_PLAN).all():
        raise InputError(f"times: expected at most {LONGEST_PLAN:g} s from now, got {found[np.abs(found).argmax()]:g}")
    late = np.flatnonzero(~(np.diff(found) >= SHORTEST_STEP))
    if len(late):
        k = int(late[0])
        raise InputError(f"times: expected rising ones, got {found[k]:g} and then {found[k + 1]:g} s at point {k + 1}")
    return found


def _rows(given: Any, what: str, count: int, names: list[str]) -> Floats | None:
    if given is None:
        return None
    rows = np.array(as_numbers(given, what, f"numbers ({count}, {len(names)})"))
    if rows.shape != (count, len(names)):
        raise InputError(
            f"{what}: expected shape ({count}, {len(names)}), one for each point and joint, got {rows.shape}"
        )
    bad = np.argwhere(~(np.abs(rows) <= LARGEST_INPUT))
    if len(bad):
        k, j = bad[0].tolist()
        where = f"{rows[k, j]:g} for {names[j]} at point {k}"
        raise InputError(f"{what}: expected finite numbers up to {LARGEST_INPUT:g}, got {where}")
    return rows


def _polynomials(spans: Floats, state: list[Floats]) -> Floats:
    """Coefficients (N - 1, K, 2, 4 or 6) between points with positions, velocities and accelerations (N, K)."""
    h = spans[:, None]
    scaled = [one * h**k for k, each in enumerate(state) for one in (each[:-1], each[1:])]
    low = [scaled[0], scaled[2] if len(state) > 1 else scaled[1] - scaled[0]]
    if len(state) == 3:
        low.append(0.5 * scaled[4])
    table = {1: np.zeros((0, 2)), 2: _CUBIC, 3: _QUINTIC}[len(state)]
    high = [sum(factor * each for factor, each in zip(row, scaled, strict=True)) for row in table.tolist()]
    return np.stack([each / h**k for k, each in enumerate([*low, *high])], axis=2)


def _check_speed(spans: Floats, coefficients: Floats, names: list[str]) -> None:
    """Raise InputError where a joint is too fast, or too far, between two points: a wrong unit."""
    h = spans[:, None]
    size = sum(k * np.abs(coefficients[:, :, k]) * h ** (k - 1) for k in range(1, coefficients.shape[2]))
    bad = np.argwhere(~(size <= FASTEST))
    if len(bad):
        k, j = bad[0].tolist()
        raise InputError(f"expected at most {FASTEST:g} rad/s or m/s, got more for {names[j]} after point {k}")
