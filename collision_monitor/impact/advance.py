"""Advance of two shapes: a time until which the gap between them along an axis stays open.

The axis n turns at u. After d seconds it is n + d m and a remainder, where m = u x n. In the frame of a shape that
turns at w, it changes by k = m + n x w per second. So the gap along it is at least

    gap + d (n.v + m.p) + d^2 m.v - [h_A(n + d k_A) - h_A(n)] - [h_B(-n - d k_B) - h_B(-n)] - c d^2 / 2

p and v: position and velocity of B's origin relative to A's. A relative acceleration a adds n.a d^2 / 2, which is
counted only as far as the bound stays concave; it changes by at most a jerk j, which takes j d^3 / 6. h: support values
of the cores about those origins. c bounds the remainder: |m|^2 |p| and, for each shape, (|w - u|^2 + |w x u|) r, where
r is the distance of its farthest point. With an angular acceleration, w is that of any time of the step, and |dw/dt| r
is added.
With an axis at rest the bound is exact to second order as long as one corner stays the nearest. A face or an edge that
turns needs an axis that turns with it; otherwise the gap seems to close at |w| r.
"""

from __future__ import annotations

from math import copysign, inf, sqrt
from typing import Any, Final, NamedTuple

from collision_monitor._jit import device, inlined
from collision_monitor.geometry.vector import Vector, cross, dot
from collision_monitor.motion.motion import change_at
from collision_monitor.narrow_phase.core import rounding
from collision_monitor.shapes.calls import core_box, core_support, is_centred_box
from collision_monitor.shapes.kinds.sphere import SPHERE
from collision_monitor.tolerances import EPSILON

PIECES: Final = 8
"""Most parabolas to examine: one more than two boxes have edge directions, and one to detect the end."""


class Placed(NamedTuple):
    """Two shapes at one time, and the motion of their bodies. World axes, m, m/s, m/s^2, rad/s."""

    a: Any  # slots in the shape table
    b: Any
    R_a: Any  # (3, 3)
    R_b: Any
    o_a: Any  # offsets of the shapes from their bodies' origins
    o_b: Any
    p: Any  # position of b's origin relative to a's
    v: Any
    w_a: Any
    w_b: Any
    change: Any  # PairChange


@inlined
def in_motion(pair: Any, placed: Any, t: float, span: float) -> Placed:
    """A pair of shapes (ShapePair) that is placed at time t (PlacedPair), with how it moves in a span (s) after it."""
    A, B, a, b = pair
    oa, ob, pose, state = placed
    change = change_at(A, B, state, t, span)
    return Placed(a, b, pose.R_A, pose.R_B, oa, ob, state.p, state.v, state.w_a, state.w_b, change)


class Gap(NamedTuple):
    """Lower bound on a gap after d seconds: start + rate d - curvature d^2, minus the growth of the cores' support."""

    start: Any  # m
    rate: Any  # m/s
    curvature: Any  # m/s^2


class Axis(NamedTuple):
    """A direction in a shape's own axes, and its change there per second."""

    x: Any
    y: Any
    z: Any
    dx: Any
    dy: Any
    dz: Any


@inlined
def _seen_from(R: Any, n: Vector, k: Vector) -> Axis:
    """The direction n, which changes by k per second, in the axes of a shape with rotation R (3, 3)."""
    return Axis(
        n[0] * R[0, 0] + n[1] * R[1, 0] + n[2] * R[2, 0],
        n[0] * R[0, 1] + n[1] * R[1, 1] + n[2] * R[2, 1],
        n[0] * R[0, 2] + n[1] * R[1, 2] + n[2] * R[2, 2],
        k[0] * R[0, 0] + k[1] * R[1, 0] + k[2] * R[2, 0],
        k[0] * R[0, 1] + k[1] * R[1, 1] + k[2] * R[2, 1],
        k[0] * R[0, 2] + k[1] * R[1, 2] + k[2] * R[2, 2],
    )


@inlined
def _bend(table: Any, s: int, w: Vector, turning: Vector, u: Vector, offset: Vector, until: float) -> float:
    """Share in c, the bound on the remainder (m/s^2), of a core that turns at w; the axis turns at u.

    turning: angular acceleration, constant in the step, which takes until (s).
    """
    d = (w[0] - u[0], w[1] - u[1], w[2] - u[2])
    c = cross(w, u)
    rate = dot(d, d) + sqrt(dot(c, c))
    harder = dot(turning, turning)
    if harder > 0.0:
        harder = sqrt(harder)
        faster = sqrt(dot(d, d)) + harder * until
        rate = faster * faster + sqrt(dot(c, c)) + harder * (1.0 + until * sqrt(dot(u, u)))
    if rate == 0.0:
        return 0.0
    arm = sqrt(dot(offset, offset))
    if table.kind[s] == SPHERE:
        return rate * arm  # rotation about its own centre does not move a sphere
    radius = table.radius[s]
    return rate * (arm + (radius - rounding(table, s) + 4.0 * EPSILON * radius))


@inlined
def advance_along_axis(table: Any, at: Placed, n: Vector, m: Vector, rate: float, gap: float, until: float) -> float:
    """Return a time d in (0, until] (s) up to which the gap along the axis n (unit) stays positive; close to the last.

    m: change of n per second, across it (1/s). rate: growth of the gap without motion, from the tube (m/s). gap: along
    n now (m).
    """
    u = cross(n, m)
    nw_a, nw_b = cross(n, at.w_a), cross(n, at.w_b)
    k_a = (m[0] + nw_a[0], m[1] + nw_a[1], m[2] + nw_a[2])
    k_b = (m[0] + nw_b[0], m[1] + nw_b[1], m[2] + nw_b[2])
    rate += dot(n, at.v) + dot(m, at.p) - dot(k_a, at.o_a) + dot(k_b, at.o_b)
    acceleration, jerk, turning_a, turning_b = at.change
    bend = _bend(table, at.a, at.w_a, turning_a, u, at.o_a, until)
    bend += _bend(table, at.b, at.w_b, turning_b, u, at.o_b, until)
    mm = dot(m, m)
    if mm > 0.0:
        bent = (0.5 * sqrt(dot(acceleration, acceleration)) + jerk * until / 6.0) * until * until
        last = (at.p[0] + until * at.v[0], at.p[1] + until * at.v[1], at.p[2] + until * at.v[2])
        bend += mm * (sqrt(max(dot(at.p, at.p), dot(last, last))) + bent)
    # n turns while the bodies accelerate: m.a d^3 / 2, bounded by its chord
    bend += abs(dot(m, acceleration)) * until - dot(n, acceleration)
    bend += jerk * until * (1.0 + sqrt(mm) * until) / 3.0
    curvature = max(0.5 * bend - dot(m, at.v), 0.0)
    A, B = _seen_from(at.R_a, n, k_a), _seen_from(at.R_b, n, k_b)
    if is_centred_box(table.kind[at.a]) and is_centred_box(table.kind[at.b]):
        return _between_boxes(core_box(table, at.a), core_box(table, at.b), A, B, Gap(gap, rate, curvature), until)
    return _between_any(table, (at.a, at.b), A, B, Gap(gap, rate, curvature), until)


@inlined
def _line(size: float, x: float, dx: float, d: float) -> tuple[float, float]:
    """The line that size |x + d dx| follows near d: its depth below size |x| at d = 0, and its slope."""
    side = copysign(size, x + d * dx)
    return size * abs(x) - side * x, side * dx


@inlined
def _between_boxes(sa: Vector, sb: Vector, A: Axis, B: Axis, gap: Gap, remaining: float) -> float:
    """`advance_along_axis` for cores that are boxes: the minimum of parabolas, one for each choice of sides.

    Newton's method from outside: the roots decrease until the parabola at a root is the one that gave the root.
    """
    curvature = gap.curvature
    d, last = 0.0, inf
    for _ in range(PIECES):
        g0, s0 = _line(sa[0], A.x, A.dx, d)
        g1, s1 = _line(sa[1], A.y, A.dy, d)
        g2, s2 = _line(sa[2], A.z, A.dz, d)
        g3, s3 = _line(sb[0], B.x, B.dx, d)
        g4, s4 = _line(sb[1], B.y, B.dy, d)
        g5, s5 = _line(sb[2], B.z, B.dz, d)
        start = gap.start + ((g0 + g1) + (g2 + g3) + (g4 + g5))
        speed = ((s0 + s1) + (s2 + s3) + (s4 + s5)) - gap.rate
        root = sqrt(speed * speed + 4.0 * curvature * start)
        if speed > 0.0:
            d = 2.0 * start / (speed + root)
        else:
            d = (root - speed) / (2.0 * curvature) if curvature > 0.0 else inf
        d = min(d, remaining)
        if d >= last:
            break
        last = d
    return last


@inlined
def _gap_after(table: Any, shapes: Any, A: Axis, B: Axis, h: Any, gap: Gap, d: float) -> float:
    """Lower bound on the gap after d seconds (m); h: the support values of both shapes at d = 0."""
    a, b = shapes
    h_a, h_b = h
    value = gap.start + d * gap.rate - gap.curvature * d * d
    if A.dx != 0.0 or A.dy != 0.0 or A.dz != 0.0:
        value -= core_support(table, a, A.x + d * A.dx, A.y + d * A.dy, A.z + d * A.dz) - h_a
    if B.dx != 0.0 or B.dy != 0.0 or B.dz != 0.0:
        value -= core_support(table, b, -B.x - d * B.dx, -B.y - d * B.dy, -B.z - d * B.dz) - h_b
    return value


@device
def _between_any(table: Any, shapes: Any, A: Axis, B: Axis, gap: Gap, remaining: float) -> float:
    """`advance_along_axis` for all cores: brackets the root of the bound between times outside (bound < 0) and inside.

    The root of a chord lies inside, because the bound is concave and the chord lies below it.
    """
    h = (core_support(table, shapes[0], A.x, A.y, A.z), core_support(table, shapes[1], -B.x, -B.y, -B.z))
    low, f_low = 0.0, gap.start
    high, f_high = remaining, 0.0
    d, outside = remaining, True
    for _ in range(11):
        f = _gap_after(table, shapes, A, B, h, gap, d)
        if outside:
            if f >= 0.0:
                return d
            high, f_high = d, f
        else:
            # beyond its two points, the line through them lies above the bound: its root is past the last safe time
            drop = f_low - f
            far = d + f * ((d - low) / drop) if drop > 0.0 else high
            low, f_low = d, f  # f may be below 0 by round-off, which half of the tolerance covers
            if f <= 0.05 * gap.start:
                break
            if far < high:
                d, outside = far, True
                continue
        d, outside = low + (high - low) * (f_low / (f_low - f_high)), False
        if not d > low:
            break
    return low
