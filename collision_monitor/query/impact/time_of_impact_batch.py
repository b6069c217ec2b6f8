"""`time_of_impact_batch`: `time_of_impact` for many motions of two shapes, in one call of the monitor's kernel."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import ArrayLike, NDArray

from collision_monitor.errors import InputError, PoseError
from collision_monitor.geometry.coordinates import real_array
from collision_monitor.impact.body_impact import ImpactQuery, make_scratch
from collision_monitor.impact.impact_record import IMPACT
from collision_monitor.query.arguments import Compound
from collision_monitor.query.batch_result import BatchResult, Pairs
from collision_monitor.query.impact.impact import Impact, impact_of_times
from collision_monitor.query.impact.impact_rows import (
    ImpactTimes,
    impacts_of_rows,
    impacts_of_spheres,
    normalise_states,
)
from collision_monitor.query.impact.moving_pair import (
    ITERATIONS,
    MotionQuery,
    MovingShape,
    lay_out_pair,
    make_moving_shape,
)
from collision_monitor.query.impact.time_of_impact import check_bounded, check_query, time_of_impact
from collision_monitor.query.pair_arrays import PackedShapes
from collision_monitor.shapes.planar import is_planar
from collision_monitor.shapes.pose import Motion, Pose
from collision_monitor.shapes.registry import HalfSpace, Mesh, Points
from collision_monitor.tolerances import GJK_TOUCHING, LARGEST_INPUT, UNIT_QUATERNION

Array = NDArray[np.float64]

_STILL: Final = Motion(Pose())


@dataclass(frozen=True, eq=False)
class Impacts(BatchResult[Impact]):
    """Results for N motions, with the meaning of `Impact`: status (N,) of str, lower and upper (N,) in s.

    `impacts[k]` is the Impact of motion k, with its contact; a slice, a mask or numbers select several motions.

    >>> import collision_monitor as cm
    >>> twists = [(-1, 0, 0, 0, 0, 0), (1, 0, 0, 0, 0, 0)]
    >>> found = cm.times_of_impact(cm.Sphere(1), cm.Pose((3, 0, 0)), twists, cm.Sphere(1), cm.Pose(), (0,) * 6)
    >>> found
    Impacts(1 hit, 1 clear, 0 unresolved; first: 0, 1 s)
    >>> found[0]
    Impact(hit in 1 to 1 s)
    """

    status: NDArray[np.str_]
    lower: Array
    upper: Array
    _pairs: Pairs
    _number: NDArray[np.intp]  # (N,), in _pairs
    _is_single: NDArray[np.bool_]  # (N,): made by `time_of_impact`
    _query: MotionQuery

    def __len__(self) -> int:
        """Number of motions."""
        return len(self.status)

    def __repr__(self) -> str:
        """Return a line for a person."""
        counts = ", ".join(f"{np.count_nonzero(self.status == each)} {each}" for each in ("hit", "clear", "unresolved"))
        if (self.lower < math.inf).any():
            counts += f"; first: {int(self.lower.argmin())}, {self.lower.min():.6g} s"
        return f"Impacts({counts})"

    def _one(self, k: int) -> Impact:
        shape_a, state_a, shape_b, state_b = self._pairs.of(self._number[k])
        arguments = shape_a, motion_of(state_a), shape_b, motion_of(state_b)
        if self._is_single[k]:
            return time_of_impact(*arguments, *self._query)
        return impact_of_times((float(self.lower[k]), float(self.upper[k])), arguments)


def time_of_impact_batch(
    shape_a: Compound,
    poses_a: ArrayLike,
    twists_a: ArrayLike,
    shape_b: Compound,
    poses_b: ArrayLike,
    twists_b: ArrayLike,
    horizon: float = 2.0,
    tolerance: float = 1e-6,
    separation: float = 0.0,
    iterations: int = ITERATIONS,
) -> Impacts:
    """`time_of_impact` for poses (N, 7) x y z qx qy qz qw (m) and twists (N, 6) vx vy vz wx wy wz (m/s, rad/s).

    A single row applies to all motions. A motion takes 1 to 2 µs, for spheres 0.1 µs; it takes 1 ms if the shapes touch
    at the start, and for plane shapes and concave meshes. Raises as `time_of_impact` does.

    >>> import collision_monitor as cm
    >>> poses, still = [(2, 0, 0, 0, 0, 0, 1), (3, 0, 0, 0, 0, 0, 1)], (0, 0, 0, 0, 0, 0)
    >>> cm.time_of_impact_batch(cm.Sphere(0.5), poses, (-1, 0, 0, 0, 0, 0), cm.Sphere(0.5), poses[0], still).status
    array(['hit', 'hit'], dtype='<U10')
    """
    query = check_query(horizon, tolerance, separation, iterations)
    a, b = make_moving_shape(shape_a, _STILL, "A"), make_moving_shape(shape_b, _STILL, "B")
    check_bounded(a, b)
    state_a, state_b = check_states(poses_a, twists_a, poses_b, twists_b)
    count = len(state_a)
    times = ImpactTimes(np.full(count, math.inf), np.full(count, math.inf), np.ones(count, bool))
    if not _is_special(a, b, state_a, state_b):
        _solve(a, b, (state_a, state_b), query, times)
    lower, upper, alone = times
    status = np.where(lower == math.inf, "clear", np.where(upper == math.inf, "unresolved", "hit"))
    for k in np.flatnonzero(alone):
        one = time_of_impact(shape_a, motion_of(state_a[k]), shape_b, motion_of(state_b[k]), *query)
        status[k], lower[k], upper[k] = one.status, one.lower, one.upper
    packed = (PackedShapes(np.zeros(0), np.zeros(1, np.int64), [shape]) for shape in (shape_a, shape_b))
    pairs = Pairs(next(packed), state_a, next(packed), state_b)
    return Impacts(status, lower, upper, pairs, np.arange(count), alone, query)


def _is_special(a: MovingShape, b: MovingShape, state_a: Array, state_b: Array) -> bool:
    """Whether the kernel alone is not enough: plane shapes, meshes that may contain the other, rotating half-spaces."""
    for body, state in ((a, state_a), (b, state_b)):
        if any(isinstance(piece, Mesh | Points) for piece, _ in body.pieces):
            return True
        for shape, _ in body.shapes:
            if is_planar(shape):
                return True
            if isinstance(shape, HalfSpace) and state[:, 10:].any():
                return True
    return False


def check_states(poses_a: ArrayLike, twists_a: ArrayLike, poses_b: ArrayLike, twists_b: ArrayLike) -> list[Array]:
    """Return the states (N, 13) of A and of B, poses and twists side by side. Raises InputError, PoseError."""
    states = [_states(poses_a, twists_a, "A"), _states(poses_b, twists_b, "B")]
    try:
        return [np.ascontiguousarray(state) for state in np.broadcast_arrays(*states)]
    except ValueError:
        raise InputError(f"expected as many motions of A as of B, got {len(states[0])} and {len(states[1])}") from None


def _states(poses: ArrayLike, twists: ArrayLike, name: str) -> Array:
    """Return checked poses and twists side by side (N, 13), with normalised quaternions."""
    columns = []
    for value, width, what in ((poses, 7, "poses"), (twists, 6, "twists")):
        try:
            array = np.atleast_2d(real_array(value))
        except (TypeError, ValueError):
            raise InputError(f"{what} {name}: expected numbers (N, {width}), got {type(value).__name__}") from None
        if array.ndim != 2 or array.shape[1] != width:
            raise InputError(f"{what} {name}: expected an array (N, {width}), got shape {np.shape(value)}")
        columns.append(array)
    lengths = {len(column) for column in columns} - {1}
    if len(lengths) > 1:
        raise InputError(f"{name}: expected as many twists as poses, got {len(columns[1])} and {len(columns[0])}")
    state = np.empty((lengths.pop() if lengths else 1, 13))
    state[:, :7], state[:, 7:] = columns
    row, norm = normalise_states(state)
    if norm >= 0.0:
        raise PoseError(
            f"poses {name}: expected quaternions of unit length within {UNIT_QUATERNION:g}, "
            f"got one of length {norm:g} in row {row}"
        )
    if row >= 0:
        what = "twists" if (np.abs(state[row, :7]) <= LARGEST_INPUT).all() else "poses"
        raise PoseError(f"{what} {name}: expected finite numbers up to {LARGEST_INPUT:g}, got others in row {row}")
    return state


def motion_of(state: Array) -> Motion:
    """Motion of a state: pose (7,), twist (6,)."""
    return Motion(Pose(state[:3], state[3:7]), state[7:10], state[10:13])


def _solve(a: MovingShape, b: MovingShape, states: tuple[Array, Array], query: MotionQuery, times: ImpactTimes) -> None:
    """Fill the times; motions that touch at the start stay undecided."""
    multibody = lay_out_pair(a, b, query.horizon)
    radii = multibody.bodies.motion["radius"]
    rows = np.arange(len(times.lower))
    if not multibody.bodies.spin_radius.any():  # two spheres
        reach = float(radii.sum()) + query.separation
        impacts_of_spheres(states[0].T.copy(), states[1].T.copy(), reach, query.horizon, times)
        rows = np.flatnonzero(times.left)
    deep = query.separation - GJK_TOUCHING * float(radii[np.isfinite(radii)].sum())
    queries = tuple(ImpactQuery(margin, query.tolerance, query.iterations) for margin in (query.separation, deep))
    memory = (make_scratch(), np.zeros(1, IMPACT))
    impacts_of_rows(multibody, states, rows, query.horizon, queries, memory, times)
