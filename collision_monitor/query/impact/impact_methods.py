"""Classical methods for the time of impact, which benchmarks/impact_methods.py compares.

Each takes two convex shapes with N motions (states as in time_of_impact_batch.py, (N, 13)) and the horizon (s), and
returns the times (N,) of the first impacts (s), infinite for none. Only conservative advancement applies to every
motion and misses nothing. The docstrings of the others state what they require or miss. (Ericson, Real-Time Collision
Detection, 5.5)
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from collision_monitor._jit import device, inlined, kernel
from collision_monitor.errors import UnsupportedError
from collision_monitor.impact.body_impact import ShapePair, contact_at, make_scratch
from collision_monitor.impact.sphere_interval import sphere_interval
from collision_monitor.motion.bodies import Multibody, make_bodies
from collision_monitor.query.impact.moving_pair import (
    ITERATIONS,
    MotionQuery,
    MovingShape,
    first_impacts,
    lay_out_pair,
    make_moving_shape,
)
from collision_monitor.shapes.pose import Motion, Pose, rotation_matrix
from collision_monitor.shapes.registry import Box, HalfSpace, Shape, Sphere
from collision_monitor.tolerances import PARALLEL_SIN2

Array = NDArray[np.float64]
ImpactMethod = Callable[[Shape, Array, Shape, Array, float], Array]

STEP: Final = 1 / 60
"""Step (s) of the methods that test one time after the other: a frame."""

HALVINGS: Final = 30
"""Number of halvings of the step in which the shapes met; 2e-11 s remain."""


def _convex_shapes(shape_a: Shape, shape_b: Shape) -> tuple[MovingShape, MovingShape]:
    still = Motion(Pose())
    bodies = make_moving_shape(shape_a, still, "A"), make_moving_shape(shape_b, still, "B")
    if any(len(body.pieces) > 1 for body in bodies):
        raise UnsupportedError("expected convex shapes; supported are all but concave Mesh and Polygon")
    return bodies


def lay_out_motions(
    a: MovingShape, b: MovingShape, state_a: Array, state_b: Array, horizon: float
) -> tuple[Multibody, NDArray[np.int32]]:
    """Lay out the states (N, 13) as N bodies like a and N like b, with the pairs (N, 2) of the bodies of one row."""
    count = len(state_a)
    two = lay_out_pair(a, b, horizon)
    bodies = make_bodies(2 * count)
    for k, state in enumerate((state_a, state_b)):
        rows = slice(k * count, (k + 1) * count)
        motion = bodies.motion[rows]
        motion["radius"], motion["cover"] = two.bodies.motion["radius"][k], horizon
        for column, field in enumerate(("x", "y", "z")):
            motion[field], motion[f"v{field}"], motion[f"w{field}"] = state[:, [column, 7 + column, 10 + column]].T
        motion["rotation"] = rotation_matrix(state[:, 3:7])
        bodies.first_shape[rows] = two.bodies.first_shape[k]
        bodies.spin_radius[rows] = two.bodies.spin_radius[k]
    bodies.id[:] = np.arange(2 * count)
    pairs = np.arange(2 * count, dtype=np.int32).reshape(2, count).T.copy()
    return Multibody(two.table, two.parts, bodies), pairs


def closed_form(shape_a: Shape, a: Array, shape_b: Shape, b: Array, horizon: float) -> Array:
    """Exact time for two spheres, or a sphere and a half-space: the root of a quadratic or a linear equation."""
    if not isinstance(shape_a, Sphere) or not isinstance(shape_b, Sphere | HalfSpace):
        raise UnsupportedError("closed_form: supported are Sphere with Sphere and Sphere with HalfSpace")
    if isinstance(shape_b, Sphere):
        return swept_bounds(shape_a, a, shape_b, b, horizon)
    still = np.array([Motion(Pose(row[:3], row[3:7])).pose.rotation @ shape_b.normal for row in b])
    gap = np.einsum("ni,ni->n", still, a[:, :3] - b[:, :3]) - shape_b.offset - shape_a.radius
    speed = np.einsum("ni,ni->n", still, b[:, 7:10] - a[:, 7:10])
    with np.errstate(divide="ignore", invalid="ignore"):
        time = np.where(gap <= 0.0, 0.0, np.where(speed > 0.0, gap / speed, math.inf))
    return np.where(time <= horizon, time, math.inf)


def swept_bounds(shape_a: Shape, a: Array, shape_b: Shape, b: Array, horizon: float) -> Array:
    """Time at which the bounding spheres first meet: a lower bound for any rotation inside them."""
    multibody, pairs = lay_out_motions(*_convex_shapes(shape_a, shape_b), a, b, horizon)
    times = np.empty(len(a))
    _swept_bounds(multibody.bodies.motion, pairs, horizon, times)
    return times


def swept_sat(shape_a: Shape, a: Array, shape_b: Shape, b: Array, horizon: float) -> Array:
    """Exact time for boxes that do not rotate: the first at which they overlap on all 15 axes of SAT.

    Rotation is ignored: a rotating box keeps its orientation of the start. (Ericson, 5.5.8)
    """
    if not (isinstance(shape_a, Box) and isinstance(shape_b, Box)):
        raise UnsupportedError("swept_sat: supported is Box with Box")
    multibody, pairs = lay_out_motions(*_convex_shapes(shape_a, shape_b), a, b, horizon)
    times = np.empty(len(a))
    _swept_sat(multibody.table, multibody.bodies, pairs, horizon, times)
    return times


def conservative_advancement(
    shape_a: Shape, a: Array, shape_b: Shape, b: Array, horizon: float, tolerance: float = 1e-6
) -> Array:
    """Lower ends of the intervals of `time_of_impact`: never late, and early by what the tolerance (m) allows."""
    multibody, pairs = lay_out_motions(*_convex_shapes(shape_a, shape_b), a, b, horizon)
    times = np.full(len(a), math.inf)
    events = first_impacts(multibody, pairs, 0.0, MotionQuery(horizon, tolerance, 0.0, ITERATIONS))
    times[events["i"]] = events["lower"]
    return times


def bisection(
    shape_a: Shape, a: Array, shape_b: Shape, b: Array, horizon: float, step: float = STEP, halvings: int = HALVINGS
) -> Array:
    """Step until the shapes overlap, then bisect the last step. Contacts that begin and end in one step are missed."""
    multibody, pairs = lay_out_motions(*_convex_shapes(shape_a, shape_b), a, b, horizon)
    times = np.empty(len(a))
    _bisect(multibody, pairs, horizon, step, halvings, times, make_scratch())
    return times


def end_of_step(shape_a: Shape, a: Array, shape_b: Shape, b: Array, horizon: float, step: float = STEP) -> Array:
    """End of the first step at which the shapes overlap, without bisection: late by up to a step, or missed."""
    return bisection(shape_a, a, shape_b, b, horizon, step, 0)


METHODS: Final[dict[str, ImpactMethod]] = {
    "closed_form": closed_form,
    "swept_bounds": swept_bounds,
    "swept_sat": swept_sat,
    "conservative_advancement": conservative_advancement,
    "bisection": bisection,
    "end_of_step": end_of_step,
}


@kernel
def _swept_bounds(motion: Any, pairs: Any, horizon: float, times: Any) -> None:
    for k in range(len(pairs)):
        A, B = motion[pairs[k, 0]], motion[pairs[k, 1]]
        p, v = (B.x - A.x, B.y - A.y, B.z - A.z), (B.vx - A.vx, B.vy - A.vy, B.vz - A.vz)
        times[k], _ = sphere_interval(p, v, A.radius + B.radius, 0.0, horizon, 1.0)


@kernel
def _bisect(multibody: Any, pairs: Any, horizon: float, step: float, halvings: int, times: Any, scratch: Any) -> None:
    table, parts, bodies = multibody
    for k in range(len(pairs)):
        i, j = pairs[k, 0], pairs[k, 1]
        pair = ShapePair(bodies.motion[i], bodies.motion[j], bodies.first_shape[i], bodies.first_shape[j])
        times[k] = math.inf
        count = math.ceil(horizon / step)
        for n in range(count + 1):
            late = min(n * step, horizon)
            if contact_at(table, parts, pair, late, scratch) <= 0.0:
                early = max((n - 1) * step, 0.0)
                for _ in range(halvings if n > 0 else 0):
                    middle = 0.5 * (early + late)
                    if contact_at(table, parts, pair, middle, scratch) <= 0.0:
                        late = middle
                    else:
                        early = middle
                times[k] = late
                break


@kernel
def _swept_sat(table: Any, bodies: Any, pairs: Any, horizon: float, times: Any) -> None:
    for k in range(len(pairs)):
        times[k] = _first_on_all_axes(table, bodies, pairs[k, 0], pairs[k, 1], horizon)


@device
def _first_on_all_axes(table: Any, bodies: Any, i: int, j: int, horizon: float) -> float:
    A, B, a, b = bodies.motion[i], bodies.motion[j], bodies.first_shape[i], bodies.first_shape[j]
    R, S = A.rotation, B.rotation
    p = (B.x - A.x, B.y - A.y, B.z - A.z)
    v = (B.vx - A.vx, B.vy - A.vy, B.vz - A.vz)
    first, last = 0.0, horizon
    for axis in range(15):
        if axis < 3:
            x, y, z = R[0, axis], R[1, axis], R[2, axis]
        elif axis < 6:
            x, y, z = S[0, axis - 3], S[1, axis - 3], S[2, axis - 3]
        else:
            m, n = (axis - 6) // 3, (axis - 6) % 3
            x = R[1, m] * S[2, n] - R[2, m] * S[1, n]
            y = R[2, m] * S[0, n] - R[0, m] * S[2, n]
            z = R[0, m] * S[1, n] - R[1, m] * S[0, n]
            if x * x + y * y + z * z < PARALLEL_SIN2:
                continue
        reach = _reach(table, a, R, x, y, z) + _reach(table, b, S, x, y, z)
        apart, speed = x * p[0] + y * p[1] + z * p[2], x * v[0] + y * v[1] + z * v[2]
        if speed < 0.0:
            apart, speed = -apart, -speed
        if speed == 0.0:
            if abs(apart) > reach:
                return math.inf
            continue
        first = max(first, (-reach - apart) / speed)
        last = min(last, (reach - apart) / speed)
        if first > last:
            return math.inf
    return first


@inlined
def _reach(table: Any, s: int, R: Any, x: float, y: float, z: float) -> float:
    """Half the width of a box along an axis."""
    total = 0.0
    for k in range(3):
        total += abs(x * R[0, k] + y * R[1, k] + z * R[2, k]) * table.size[s, k]
    return total
