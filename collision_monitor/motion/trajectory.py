"""Trajectories: planned motions, as pieces that follow each other, each of them one of the motions of course.py.

A piece goes straight, along an arc, or stands. Curves (cubic and quintic Hermite splines) are cut into straight pieces
with constant accelerations, and the tube of a piece bounds how far the curve is from it.
"""

from __future__ import annotations

from math import inf
from typing import Any, Final, Literal, NamedTuple, get_args

import numpy as np
from numpy.typing import NDArray

from collision_monitor._jit import allocating_kernel, kernel, outlined
from collision_monitor.checks.numbers import as_numbers, checked_number
from collision_monitor.errors import PoseError
from collision_monitor.motion.course import ARC, STRAIGHT, bends, screw_velocity, turned_for
from collision_monitor.motion.curves import cubic, parabolas, quintic
from collision_monitor.motion.motion import turn_between, turn_quaternion, twist_on
from collision_monitor.motion.stated_motion import (
    ACCELERATION,
    ANGULAR,
    COURSE,
    LINEAR,
    NUMBERS,
    REST,
    Motion,
)
from collision_monitor.shapes.planar import flat_quaternions
from collision_monitor.shapes.pose import Frozen, Pose, as_pose
from collision_monitor.tolerances import EPSILON, LARGEST_INPUT, NORMALISED, UNIT_QUATERNION

Array = NDArray[np.float64]
Between = Literal["straight", "arc", "curve"]
Then = Literal["rest", "go on", "unknown"]
_Pieces = tuple[Array, Array, Array]

MOST_POINTS: Final = 100_000
"""Points of a trajectory: half an hour at 50 Hz. A trajectory takes 150 bytes for each piece."""

FASTEST: Final = 1e5
"""m/s, and rad/s. A plan that asks for more has a wrong time or a wrong unit."""

SHORTEST: Final = 1e-12
"""s between two points. Less: the third derivative of a curve overflows. Such points have a wrong unit."""

ROUND_OFF_ANGLE: Final = 64.0 * EPSILON
"""rad, up to which two orientations are one: quaternions of one orientation, computed in two ways, differ by as much.
Larger: a body jumps between two points. Smaller: a HalfSpace, which cannot turn, is refused for round-off."""


class Tolerance(NamedTuple):
    """How far a body may be off its plan and still follows it. All are at least 0.

    >>> Tolerance(across=0.05).along
    0.2
    """

    across: float = 0.1
    """m, across the direction of the planned velocity; in any direction where the plan stands."""
    along: float = 0.2
    """m, along it."""
    angle: float = 0.1
    """rad."""
    time: float = 0.2
    """s by which it may be early or late, which adds to `along`."""


class Trajectory(Frozen):
    """A planned motion: poses at times, and what lies between them. Raises PoseError.

    times (N,): s from now on, rising; the first may lie in the past. Before it the body rests at its first pose. poses:
    (N, 7) x y z qx qy qz qw, or a sequence of what `as_pose` takes. twists (N, 6) or (N, 3): linear velocities (m/s,
    world axes) at the points, which a curve needs; how fast the body turns follows from the poses.
    accelerations (N, 3): m/s^2, world axes, at the points of a curve.
    between: "straight", constant velocity and angular velocity (of a polyline with slerp); "arc", constant twist in the
    body's own frame, as a wheeled robot follows a path (Murray, Li and Sastry, 1994, 2.3); "curve", the cubic Hermite
    spline, or with accelerations the quintic one, with a constant angular velocity between two points. The default is
    "curve" with twists, "straight" without.
    A curve is known to 1e-6 m, so an impact with what it touches or slides along is unresolved.
    tube: how far the body's points may be off what lies between two points (m).
    then: what holds after the last point: "rest"; "go on" along the last piece; "unknown": no answer is clear beyond.

    >>> path = Trajectory([0, 1, 3], [(0, 0, 0), (1, 0, 0), (1, 4, 0)])
    >>> path.at(2.0).position
    array([1., 2., 0.])
    """

    times: Array
    poses: Array
    twists: Array | None
    """(N, 3): linear velocities at the points, as far as they were given."""
    accelerations: Array | None
    """(N, 3): linear accelerations at the points, as far as they were given."""
    between: Between
    then: Then
    tube: float
    begins: Array
    """(M,): s at which each piece begins."""
    numbers: Array
    """(M, NUMBERS): the motion of each piece from its begin on."""
    tubes: Array
    """(M,): m by which the body may be off each piece."""

    def __init__(
        self,
        times: Any,
        poses: Any,
        twists: Any = None,
        *,
        accelerations: Any = None,
        between: Between | None = None,
        then: Then = "rest",
        tube: float = 0.0,
    ) -> None:
        known = self.__dict__
        if between is None:
            between = "straight" if twists is None else "curve"
        _check_choice(between, "between", get_args(Between))
        _check_choice(then, "then", get_args(Then))
        known["times"] = times = _checked_times(times)
        known["poses"] = poses = _checked_poses(poses, len(times))
        known["twists"] = velocities = None if twists is None else _checked_rates(twists, len(times), "twists", 6)
        if between == "curve" and velocities is None:
            raise PoseError("twists: expected linear velocities at the points of a curve, got none")
        if between != "curve" and accelerations is not None:
            raise PoseError(f"accelerations: expected a curve with twists, got accelerations and between={between!r}")
        rates = None if accelerations is None else _checked_rates(accelerations, len(times), "accelerations", 3)
        known["accelerations"] = rates
        known["between"], known["then"] = between, then
        known["tube"] = tube = checked_number(tube, "tube", "m", least=0.0, error=PoseError)
        spans = np.diff(times)
        turns = np.empty((len(spans), 3))
        _rotation_vectors(poses, turns)
        rows = _still_rows(poses[:-1])
        begins, tubes = times[:-1], np.zeros(len(spans))
        with np.errstate(over="ignore"):  # what overflows is too fast
            rows[:, ANGULAR:ACCELERATION] = turns / spans[:, None]
            secants = np.diff(poses[:, :3], axis=0) / spans[:, None]
            _check_speeds(secants, rows[:, ANGULAR:ACCELERATION])
        if between == "curve" and velocities is not None:
            rows, begins, tubes = _curves(times, poses, velocities, rates, rows)
        elif between == "arc":
            _bend_rows(rows, np.diff(poses[:, :3], axis=0), turns, spans)
        else:
            rows[:, LINEAR:ANGULAR] = secants
        first, last = _still_rows(poses[:1]), _still_rows(poses[-1:])
        if then == "go on":
            last = carried(rows[-1:], times[-1:] - begins[-1:])
            if between == "curve" and velocities is not None:
                last[:, LINEAR:ANGULAR], last[:, ACCELERATION:COURSE] = velocities[-1], 0.0
        known["numbers"] = np.concatenate([first, rows, last])
        known["begins"] = np.concatenate([[-LARGEST_INPUT], begins, times[-1:]])
        known["tubes"] = np.concatenate([[0.0], tubes + tube, [tube if then == "go on" else 0.0]])
        for each in known.values():
            if isinstance(each, np.ndarray):
                each.setflags(write=False)

    def __repr__(self) -> str:
        """Return how many points there are, when they are, and what follows, for a person."""
        first, last = self.times[0], self.times[-1]
        return f"{type(self).__name__}({len(self.times)} points, {first:g} to {last:g} s, then {self.then})"

    def __reduce__(self) -> tuple[Any, ...]:
        """Copies and pickles hold what it was made of."""
        return _made_of, (self.times, self.poses, self.twists, self.accelerations, self.between, self.then, self.tube)

    @property
    def pose(self) -> Pose:
        """The pose now."""
        return self.at(0.0)

    @property
    def angular(self) -> Array:
        """(M, 3): angular velocity of each piece (rad/s, world axes)."""
        return self.numbers[:, ANGULAR:ACCELERATION]

    def piece(self, time: Any) -> Any:
        """Index of the piece that holds at a time or at times (s)."""
        return np.maximum(np.searchsorted(self.begins, time, side="right") - 1, 0)

    def rows(self, times: Array) -> Array:
        """The motions (T, NUMBERS) that hold from some times (T,) on."""
        k = self.piece(times)
        return carried(self.numbers[k], times - self.begins[k])

    def at(self, time: float) -> Pose:
        """The pose at a time (s). Raises PoseError."""
        time = checked_number(time, "time", "s", error=PoseError)
        return Pose.of_numbers(self.rows(np.array([time]))[0, :LINEAR].tolist())

    def flat(self) -> Trajectory:
        """The trajectory of a shape in the x-y plane, without what leads out of it. Raises PoseError."""
        known: Trajectory | None = self.__dict__.get("_flat")
        if known is None:
            known = self.__dict__["_flat"] = _flat(self)
        return known


def _made_of(
    times: Array, poses: Array, twists: Array | None, rates: Array | None, between: Between, then: Then, tube: float
) -> Trajectory:  # fmt: skip
    return Trajectory(times, poses, twists, accelerations=rates, between=between, then=then, tube=tube)


def _flat(path: Trajectory) -> Trajectory:
    """The trajectory through the points of another one without height and tilt. Raises PoseError."""
    poses = np.zeros_like(path.poses)
    poses[:, :2], poses[:, 3:] = path.poses[:, :2], flat_quaternions(path.poses[:, 3:])
    down = np.flatnonzero(~poses[:, 3:].any(axis=1))
    if len(down):
        quaternion = path.poses[down[0], 3:].tolist()
        raise PoseError(
            f"expected z to point up for a shape of the plane, got quaternion {quaternion} at point {down[0]}"
        )
    twists, accelerations = (
        None if each is None else each * (1.0, 1.0, 0.0) for each in (path.twists, path.accelerations)
    )
    return _made_of(path.times, poses, twists, accelerations, path.between, path.then, path.tube)


def _check_choice(value: Any, name: str, choices: tuple[str, ...]) -> None:
    if not (isinstance(value, str) and value in choices):
        raise PoseError(f"{name}: expected one of {', '.join(map(repr, choices))}, got {value!r:.100}")


def _checked_times(times: Any) -> Array:
    array = np.array(as_numbers(times, "times", "numbers (N,)", PoseError))
    if array.ndim != 1 or not 2 <= len(array) <= MOST_POINTS:
        raise PoseError(f"times: expected 2 to {MOST_POINTS} numbers (N,), got shape {array.shape}")
    bad = np.flatnonzero(~(np.abs(array) <= LARGEST_INPUT))
    if len(bad):
        k = int(bad[0])
        raise PoseError(f"times: expected finite numbers up to {LARGEST_INPUT:g}, got {array[k]:g} at point {k}")
    late = np.flatnonzero(~(np.diff(array) > 0.0))
    if len(late):
        k = int(late[0])
        raise PoseError(f"times: expected rising ones, got {array[k]:g} and then {array[k + 1]:g} at point {k + 1}")
    close = np.flatnonzero(np.diff(array) < SHORTEST)
    if len(close):
        k = int(close[0])
        raise PoseError(f"times: expected at least {SHORTEST:g} s between two points, got {array[k + 1] - array[k]:g} "
                        f"from point {k} on")  # fmt: skip
    return array


def _checked_poses(poses: Any, count: int) -> Array:
    if isinstance(poses, np.ndarray) and poses.ndim == 2:
        rows = np.array(as_numbers(poses, "poses", "numbers (N, 7)", PoseError))
    elif isinstance(poses, list | tuple) or (isinstance(poses, np.ndarray) and poses.ndim):
        rows = np.array([as_pose(each, f"poses, point {k}").numbers for k, each in enumerate(poses)]).reshape(-1, 7)
    else:
        raise PoseError(f"poses: expected an array (N, 7) or a sequence of poses, got {type(poses).__name__}")
    if rows.shape == (count, 3):
        rows = np.concatenate([rows, np.tile((0.0, 0.0, 0.0, 1.0), (count, 1))], axis=1)
    if rows.shape != (count, 7):
        raise PoseError(f"poses: expected shape ({count}, 7), one for each time, got {rows.shape}")
    bad = np.flatnonzero(~(np.abs(rows) <= LARGEST_INPUT).all(axis=1))
    if len(bad):
        raise PoseError(f"poses: expected finite numbers up to {LARGEST_INPUT:g}, got others at point {bad[0]}")
    norms = np.linalg.norm(rows[:, 3:], axis=1)
    bad = np.flatnonzero(np.abs(norms - 1.0) > UNIT_QUATERNION)
    if len(bad):
        k = int(bad[0])
        raise PoseError(
            f"poses: expected quaternions of unit length within {UNIT_QUATERNION:g}, got {norms[k]:g} at point {k}"
        )
    rows[:, 3:] /= np.where(np.abs(norms - 1.0) > NORMALISED, norms, 1.0)[:, None]
    return rows


def _checked_rates(rates: Any, count: int, name: str, width: int) -> Array:
    """Linear velocities or accelerations (N, 3) of rows (N, width) or (N, 3)."""
    rows = np.array(as_numbers(rates, name, f"numbers (N, {width})", PoseError))
    if rows.shape not in ((count, width), (count, 3)):
        shapes = f"({count}, 6) or ({count}, 3)" if width == 6 else f"({count}, 3)"
        raise PoseError(f"{name}: expected shape {shapes}, one for each time, got {rows.shape}")
    bad = np.flatnonzero(~(np.abs(rows) <= FASTEST).all(axis=1))
    if len(bad):
        k = int(bad[0])
        raise PoseError(f"{name}: expected finite numbers up to {FASTEST:g}, got {rows[k].tolist()} at point {k}")
    return np.ascontiguousarray(rows[:, :3])


def _check_speeds(linear: Array, angular: Array) -> None:
    for speeds, unit in ((linear, "m/s"), (angular, "rad/s")):
        size = np.linalg.norm(speeds, axis=1)
        bad = np.flatnonzero(~(size <= FASTEST))
        if len(bad):
            k = int(bad[0])
            raise PoseError(
                f"poses: expected at most {FASTEST:g} {unit} between two points, got {size[k]:g} from point {k} on; "
                "check the unit of the times"
            )


def _still_rows(poses: Array) -> Array:
    """Numbers (N, NUMBERS) of bodies that stand at poses (N, 7)."""
    rows = np.zeros((len(poses), NUMBERS))
    rows[:, :LINEAR], rows[:, REST] = poses, np.inf
    return rows


@kernel
def _rotation_vectors(poses: Any, turns: Any) -> None:
    """Write the rotation vectors (rad, world axes) of the shortest turns between poses (N, 7) to turns (N - 1, 3)."""
    for k in range(len(turns)):
        x, y, z = turn_between(poses[k], poses[k + 1])
        if x * x + y * y + z * z <= ROUND_OFF_ANGLE * ROUND_OFF_ANGLE:
            x = y = z = 0.0
        turns[k, 0], turns[k, 1], turns[k, 2] = x, y, z


@kernel
def _bend_rows(rows: Any, moved: Any, turns: Any, spans: Any) -> None:
    """Let motions (N, NUMBERS) be arcs on which bodies move by `moved` (N, 3) and turn by rotation vectors (N, 3)."""
    for k in range(len(rows)):
        turn = (turns[k, 0], turns[k, 1], turns[k, 2])
        v = screw_velocity((moved[k, 0], moved[k, 1], moved[k, 2]), turn)
        for c in range(3):
            rows[k, LINEAR + c] = v[c] / spans[k]
        if bends(v, turn):
            rows[k, COURSE] = ARC


def _curves(times: Array, poses: Array, velocities: Array, accelerations: Array | None, rows: Array) -> _Pieces:
    """Numbers, begins and tubes of the pieces of the spline through points with velocities and accelerations (N, 3).

    rows: those between the points, with their angular velocities.
    """
    h, points = np.diff(times), poses[:, :3]
    curves = cubic(h, points, velocities) if accelerations is None else quintic(h, points, velocities, accelerations)
    found = parabolas(h, curves)
    pieces = carried(rows[found.span], found.age)
    pieces[:, :3], pieces[:, LINEAR:ANGULAR] = found.position, found.velocity
    pieces[:, ACCELERATION:COURSE] = found.acceleration
    return pieces, times[found.span] + found.age, found.tube


def carried(numbers: Array, ages: Array) -> Array:
    """Motions (N, NUMBERS) as they go on from some times (N,) after their beginnings (s)."""
    out = np.empty_like(numbers, order="C")
    _carry(np.ascontiguousarray(numbers), ages, out)
    return out


@allocating_kernel
def _carry(numbers: Any, ages: Any, out: Any) -> None:
    q = np.empty(4)
    for k in range(len(numbers)):
        carry(numbers, k, ages[k], out[k], q)


@outlined
def carry(numbers: Any, k: int, t: float, to: Any, q: Any) -> None:
    """Write the motion numbers[k] (NUMBERS,) as it goes on from t (s) after its begin to `to`; q (4,): memory."""
    row = numbers[k]
    v, w, a = (row[7], row[8], row[9]), (row[10], row[11], row[12]), (row[13], row[14], row[15])
    kind, rest = int(row[COURSE]), row[REST]
    there = twist_on(kind, v, w, a, t, rest)
    turn_quaternion(numbers[:, 3:7], k, w[0], w[1], w[2], turned_for(kind, v, a, t, rest), q)
    for c in range(3):
        to[c] = row[c] + there.moved[c]
        to[LINEAR + c], to[ANGULAR + c] = there.velocity[c], there.angular[c]
        to[ACCELERATION + c] = a[c] if kind == STRAIGHT else there.velocity[c] * there.change
    for c in range(4):
        to[3 + c] = q[c]
    to[COURSE], to[REST] = row[COURSE], rest - t
    if to[REST] <= 0.0:
        to[COURSE], to[REST] = STRAIGHT, np.inf


def as_motion(value: Any, name: str) -> Motion | Trajectory:
    """Return a motion or a trajectory. Raises PoseError for anything else; name: of the argument, for the error."""
    if isinstance(value, Motion | Trajectory):
        return value
    raise PoseError(f"{name}: expected a Motion or a Trajectory, got {type(value).__name__}; write Motion(pose)")


class PairPieces(NamedTuple):
    """Two motions in parts of time within which each is one piece of a trajectory."""

    borders: Array  # (K + 1,): s
    a: Array  # (K, NUMBERS): motions from the begin of each part on
    b: Array
    tubes: Array  # (K, 2): m


def pair_pieces(a: Motion | Trajectory, b: Motion | Trajectory, horizon: float) -> PairPieces:
    """The parts of the time from now to the horizon (s), or to where one of the motions is unknown from."""
    end = min(horizon, known_until(a), known_until(b))
    begins = [each.begins for each in (a, b) if isinstance(each, Trajectory)]
    within = [each[np.searchsorted(each, 0.0, side="right") : np.searchsorted(each, end)] for each in begins]
    starts = np.unique(np.concatenate([[0.0], *within]))
    rows, tubes = [], np.zeros((len(starts), 2))
    for side, each in enumerate((a, b)):
        if isinstance(each, Trajectory):
            rows.append(each.rows(starts))
            tubes[:, side] = each.tubes[each.piece(starts)]
        else:
            rows.append(carried(np.tile((*each.pose.numbers, *each.numbers), (len(starts), 1)), starts))
    return PairPieces(np.append(starts, max(end, 0.0)), rows[0], rows[1], tubes)


def known_until(motion: Motion | Trajectory) -> float:
    """Time (s) from which on a motion is unknown; infinite: never."""
    return float(motion.times[-1]) if isinstance(motion, Trajectory) and motion.then == "unknown" else inf
