"""Classical methods for the time of impact, which benchmarks/impact_methods.py compares.

Each takes two convex shapes with N motions (states (N, 13): pose x y z qx qy qz qw, linear and angular velocity) and
the horizon (s), and returns the times (N,) of the first impacts (s), infinite for none. Only conservative advancement
applies to every motion and misses nothing. The docstrings of the others state what they require or miss. (Ericson,
Real-Time Collision Detection, 5.5)
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from collision_monitor._jit import device, inlined, kernel
from collision_monitor.errors import UnsupportedError
from collision_monitor.impact.body_impact import ShapePair, contact_at
from collision_monitor.impact.sphere_interval import sphere_interval
from collision_monitor.motion.stated_motion import Motion, straight_motions
from collision_monitor.query.body import kept_slots
from collision_monitor.query.impact.impact_kernel import MEMORY, impacts_of_chains, set_pair
from collision_monitor.query.impact.impact_query import ITERATIONS
from collision_monitor.query.library import LIBRARY
from collision_monitor.shapes.pose import Pose
from collision_monitor.shapes.registry import Box, HalfSpace, Shape, Sphere
from collision_monitor.tolerances import PARALLEL_SIN2

Array = NDArray[np.float64]
ImpactMethod = Callable[[Shape, Array, Shape, Array, float], Array]

STEP: Final = 1 / 60
"""Step (s) of the methods that test one time after the other: a frame."""

HALVINGS: Final = 30
"""Number of halvings of the step in which the shapes met; 2e-11 s remain."""


class MovingShapes(NamedTuple):
    """Two convex shapes in N motions, as the kernels take them."""

    library: tuple[Any, Any]  # ShapeTable and Parts
    motion: Any  # (2,) MOTION, memory
    chains: tuple[np.int32, np.int32]
    motions_a: Array  # (N, NUMBERS) of a Motion
    motions_b: Array


def moving_shapes(shape_a: Shape, a: Array, shape_b: Shape, b: Array) -> MovingShapes:
    """Lay out two shapes with states (N, 13)."""
    kept = kept_slots(shape_a), kept_slots(shape_b)
    if not all(each is not None and each.is_convex for each in kept):
        raise UnsupportedError("expected convex shapes; supported are all but compounds, concave Mesh and Polygon")
    chains = np.int32(kept[0].first), np.int32(kept[1].first)  # type: ignore[union-attr]
    motions = straight_motions(a), straight_motions(b)
    return MovingShapes(LIBRARY.tuples, MEMORY.motion, chains, *motions)


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
    times = np.empty(len(a))
    _swept_bounds(moving_shapes(shape_a, a, shape_b, b), horizon, times)
    return times


def swept_sat(shape_a: Shape, a: Array, shape_b: Shape, b: Array, horizon: float) -> Array:
    """Exact time for boxes that do not rotate: the first at which they overlap on all 15 axes of SAT.

    Rotation is ignored: a rotating box keeps its orientation of the start. (Ericson, 5.5.8)
    """
    if not (isinstance(shape_a, Box) and isinstance(shape_b, Box)):
        raise UnsupportedError("swept_sat: supported is Box with Box")
    times = np.empty(len(a))
    _swept_sat(moving_shapes(shape_a, a, shape_b, b), horizon, times)
    return times


def conservative_advancement(
    shape_a: Shape, a: Array, shape_b: Shape, b: Array, horizon: float, tolerance: float = 1e-6
) -> Array:
    """Lower ends of the intervals of `time_of_impact`: never late, and early by what the tolerance (m) allows."""
    (table, parts), _, chains, motions_a, motions_b = moving_shapes(shape_a, a, shape_b, b)
    first_a, first_b = np.array(chains[:1]), np.array(chains[1:])
    query, rows = np.array([horizon, tolerance, 0.0, ITERATIONS]), np.empty((len(a), 3))
    impacts_of_chains(table, parts, MEMORY.scratch, MEMORY.moving, first_a, motions_a, first_b, motions_b, query, rows)
    return np.ascontiguousarray(rows[:, 0])


def bisection(
    shape_a: Shape, a: Array, shape_b: Shape, b: Array, horizon: float, step: float = STEP, halvings: int = HALVINGS
) -> Array:
    """Step until the shapes overlap, then bisect the last step. Contacts that begin and end in one step are missed."""
    times = np.empty(len(a))
    _bisect(moving_shapes(shape_a, a, shape_b, b), horizon, step, halvings, times, MEMORY.scratch)
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
def _swept_bounds(moving: Any, horizon: float, times: Any) -> None:
    (table, parts), motion, chains, motions_a, motions_b = moving
    for k in range(len(times)):
        set_pair(table, parts, chains, motion, motions_a, k, motions_b, k)
        A, B = motion[0], motion[1]
        p, v = (B.x - A.x, B.y - A.y, B.z - A.z), (B.vx - A.vx, B.vy - A.vy, B.vz - A.vz)
        times[k], _ = sphere_interval(p, v, A.radius + B.radius, 0.0, horizon, 1.0)


@kernel
def _bisect(moving: Any, horizon: float, step: float, halvings: int, times: Any, scratch: Any) -> None:
    (table, parts), motion, chains, motions_a, motions_b = moving
    pair = ShapePair(motion[0], motion[1], chains[0], chains[1])
    for k in range(len(times)):
        set_pair(table, parts, chains, motion, motions_a, k, motions_b, k)
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
def _swept_sat(moving: Any, horizon: float, times: Any) -> None:
    (table, parts), motion, chains, motions_a, motions_b = moving
    for k in range(len(times)):
        set_pair(table, parts, chains, motion, motions_a, k, motions_b, k)
        times[k] = _first_on_all_axes(table, motion[0], motion[1], chains[0], chains[1], horizon)


@device
def _first_on_all_axes(table: Any, A: Any, B: Any, a: int, b: int, horizon: float) -> float:
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
