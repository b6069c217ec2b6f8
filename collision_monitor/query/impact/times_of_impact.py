"""`times_of_impact`: `time_of_impact` for arrays of pairs."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from collision_monitor.checks.numbers import checked_rows
from collision_monitor.errors import PoseError
from collision_monitor.motion.stated_motion import (
    ACCELERATION,
    COURSE,
    LINEAR,
    Frame,
    Motion,
    is_body_frame,
    motion_of,
    set_courses,
    straight_motions,
)
from collision_monitor.query.batch_result import BatchResult, Pairs
from collision_monitor.query.impact.impact import Impact, impact_of_times
from collision_monitor.query.impact.impact_kernel import MEMORY, TOUCHES, impacts_of_chains
from collision_monitor.query.impact.impact_query import ITERATIONS, MotionQuery, check_query
from collision_monitor.query.impact.time_of_impact import time_of_impact
from collision_monitor.query.library import LIBRARY
from collision_monitor.query.pair_arrays import (
    BatchShapes,
    Progress,
    Shapes,
    batch_shapes,
    pair_count,
    pair_ranges,
    part,
    pose_of,
    pose_rows,
)
from collision_monitor.tolerances import LARGEST_INPUT

Array = NDArray[np.float64]


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
        arguments = shape_a, _motion(state_a), shape_b, _motion(state_b)
        if self._is_single[k]:
            return time_of_impact(*arguments, *self._query)
        return impact_of_times((float(self.lower[k]), float(self.upper[k])), arguments)


def times_of_impact(
    shapes_a: Shapes,
    poses_a: Any,
    twists_a: ArrayLike,
    shapes_b: Shapes,
    poses_b: Any,
    twists_b: ArrayLike,
    horizon: float = 2.0,
    tolerance: float = 1e-6,
    separation: float = 0.0,
    iterations: int = ITERATIONS,
    progress: Progress | None = None,
    *,
    accelerations_a: ArrayLike | None = None,
    accelerations_b: ArrayLike | None = None,
    frame: Frame = "world",
    stops: bool = False,
) -> Impacts:
    """`time_of_impact` for N pairs of moving shapes.

    shapes: one for all pairs, or a list of N; poses: (N, 7) x y z qx qy qz qw (m), a list of N, or one for all;
    twists: (N, 6) vx vy vz wx wy wz (m/s, rad/s), or one for all; accelerations: (N, 3) m/s^2, or one for all; frame,
    stops: of all motions, see `Motion`. progress: called with the number of pairs that are done. Convex solids take 0.2
    to 5 µs a pair; compounds, open meshes, and shapes that touch at the start, 0.1 to 1 ms. Raises as `time_of_impact`
    does, and InputError if the lengths differ.

    >>> import collision_monitor as cm
    >>> poses = [(x, 0, 0, 0, 0, 0, 1) for x in (2, 2.5, 9)]
    >>> still, towards = (0, 0, 0, 0, 0, 0), (-1, 0, 0, 0, 0, 0)
    >>> cm.times_of_impact(cm.Box((1, 1, 1)), cm.Pose(), still, cm.Sphere(0.5), poses, towards).status
    array(['hit', 'hit', 'clear'], dtype='<U10')
    """
    query = check_query(horizon, tolerance, separation, iterations)
    a, b = batch_shapes(shapes_a, "shapes A"), batch_shapes(shapes_b, "shapes B")
    if a.has_mesh or b.has_mesh:
        a.plant()
        b.plant()
    courses = is_body_frame(frame), bool(stops)
    s_a = _motions(poses_a, twists_a, accelerations_a, courses, "A")
    s_b = _motions(poses_b, twists_b, accelerations_b, courses, "B")
    count = pair_count(shapes_a=len(a), motions_a=len(s_a), shapes_b=len(b), motions_b=len(s_b))
    turns_a, turns_b = (s[:, 10:13].any(axis=1) for s in (s_a, s_b))
    is_refused = (~a.is_bounded & (turns_a | ~b.is_bounded)) | (~b.is_bounded & turns_b)  # by a single query
    first_a, first_b = np.where(is_refused, np.int32(-1), a.first), b.first
    is_single = np.broadcast_to((first_a < 0) | (first_b < 0), (count,)).copy()
    rows = np.full((count, 3), math.inf)
    for which in pair_ranges(count, progress):
        impacts_of_chains(
            *LIBRARY.tuples, MEMORY.scratch, MEMORY.moving, part(first_a, which), part(s_a, which),
            part(first_b, which), part(s_b, which), np.array(query, np.float64), rows[which],
        )  # fmt: skip
        is_single[which] |= rows[which, 2] == TOUCHES
        for k in (which.start + np.flatnonzero(is_single[which])).tolist():
            one = time_of_impact(*_arguments(a, s_a, b, s_b, k), *query)
            rows[k, :2] = one.lower, one.upper
    lower, upper, _ = rows.T
    status = np.where(lower == math.inf, "clear", np.where(upper == math.inf, "unresolved", "hit"))
    return Impacts(status, lower.copy(), upper.copy(), Pairs(a, s_a, b, s_b), np.arange(count), is_single, query)


time_of_impact_batch = times_of_impact
"""The older name."""


def _motions(
    poses: Any, twists: ArrayLike, accelerations: ArrayLike | None, courses: tuple[bool, bool], name: str
) -> Array:
    """Checked motions (N, NUMBERS). courses: whether vectors are along the bodies' axes, and bodies stop."""
    x, v = pose_rows(poses, f"poses {name}"), checked_rows(twists, 6, f"twists {name}", LARGEST_INPUT, PoseError)
    a = np.zeros((1, 3))
    if accelerations is not None:
        a = checked_rows(accelerations, 3, f"accelerations {name}", LARGEST_INPUT, PoseError)
    counts = {f"poses {name}": len(x), f"twists {name}": len(v), f"accelerations {name}": len(a)}
    states = np.empty((pair_count(**counts), ACCELERATION))
    states[:, :LINEAR], states[:, LINEAR:] = x, v
    rows = straight_motions(states)
    rows[:, ACCELERATION:COURSE] = a
    along_body, stops = courses
    if along_body or stops:
        set_courses(rows, along_body, along_body, stops)
    return rows


def _arguments(a: BatchShapes, s_a: Array, b: BatchShapes, s_b: Array, k: int) -> tuple[Any, Motion, Any, Motion]:
    rows = (s[k if len(s) > 1 else 0] for s in (s_a, s_b))
    return a.of(k), _motion(next(rows)), b.of(k), _motion(next(rows))


def _motion(row: Array) -> Motion:
    return motion_of(pose_of(row), row)
