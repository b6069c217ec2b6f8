"""Motion of bodies: the course from a reference state (course.py), and a tube that bounds the deviation from it.

Every point of a body stays within tube_0 + tube_1 * (t - tube_time) metres of its place in the reference motion. While
that holds, the predictions made from the reference motion hold too. The tube of a stale object is wider (tracking.py).
"""

from __future__ import annotations

from math import inf, sqrt
from typing import Any, Final, NamedTuple

import numpy as np

from collision_monitor._jit import device, inlined, outlined
from collision_monitor.broad_phase.region import Region, hull_of_regions
from collision_monitor.geometry.vector import Vector, minus, scaled
from collision_monitor.motion.course import (
    STRAIGHT,
    Change,
    Place,
    change_on,
    most_acceleration,
    place_on,
    speed_change,
    turned_for,
)
from collision_monitor.motion.trigonometry import sin_cos

MOTION = np.dtype(
    [
        ("x", np.float64),  # position at `time` (m)
        ("y", np.float64),
        ("z", np.float64),
        ("vx", np.float64),  # m/s
        ("vy", np.float64),
        ("vz", np.float64),
        ("ax", np.float64),  # m/s^2: of the origin, see Course
        ("ay", np.float64),
        ("az", np.float64),
        ("radius", np.float64),  # of the sphere about the body's origin that holds all its shapes
        ("time", np.float64),  # s after the monitor's origin, like all times
        ("tube_0", np.float64),  # m
        ("tube_1", np.float64),  # m/s
        ("spread_0", np.float64),  # m: width of its box for its uncertainty, from tube_time on
        ("spread_1", np.float64),  # m/s
        ("tube_time", np.float64),  # when the body was last within tube_0 of the reference
        ("cover", np.float64),  # collisions are predicted until this time
        ("covered", np.float64),  # and were until this time before this step; -inf: not at all
        ("wx", np.float64),  # rad/s
        ("wy", np.float64),
        ("wz", np.float64),
        ("rotation", np.float64, (3, 3)),  # at `time`
        ("course", np.int64),  # kind of its Course
        ("rest", np.float64),  # from which on the body stands; infinite: never
        ("until", np.float64),  # to which it holds; from then on, the next piece of a plan does. Infinite: for ever
        ("piece", np.int64),  # its index among the pieces of all plans, if it is one of a plan
        ("anew", np.float64),  # when the body was predicted anew, and not only further
    ]
)
"""The reference motion that predictions rest on. One record per body, because a prediction reads two of them whole."""


FEWEST_PIECES: Final = 4
MOST_PIECES: Final = 32
PIECE: Final = 0.5
"""How the path of a motion that bends is divided for its swept box: least and largest number of pieces, and the angle
(rad) of a piece between. Smaller: narrower boxes, by 3 % of the radius of an arc for 0.5. Each piece costs 60 ns."""


@inlined
def quaternion_to_matrix(q: Any, i: int, out: Any) -> None:
    """Write the rotation matrix of the unit quaternion q[i] (x, y, z, w) into out (3, 3)."""
    x, y, z, w = q[i, 0], q[i, 1], q[i, 2], q[i, 3]
    out[0, 0] = 1.0 - 2.0 * (y * y + z * z)
    out[0, 1] = 2.0 * (x * y - w * z)
    out[0, 2] = 2.0 * (x * z + w * y)
    out[1, 0] = 2.0 * (x * y + w * z)
    out[1, 1] = 1.0 - 2.0 * (x * x + z * z)
    out[1, 2] = 2.0 * (y * z - w * x)
    out[2, 0] = 2.0 * (x * z - w * y)
    out[2, 1] = 2.0 * (y * z + w * x)
    out[2, 2] = 1.0 - 2.0 * (x * x + y * y)


@device
def set_piece(piece: Any, m: Any) -> None:
    """Let the motion m (MOTION) go on as a piece of a plan does. Its radius, its tube and its cover stay."""
    m.x, m.y, m.z = piece.x, piece.y, piece.z
    m.vx, m.vy, m.vz = piece.vx, piece.vy, piece.vz
    m.wx, m.wy, m.wz = piece.wx, piece.wy, piece.wz
    m.ax, m.ay, m.az = piece.ax, piece.ay, piece.az
    for r in range(3):
        for c in range(3):
            m.rotation[r, c] = piece.rotation[r, c]
    m.time, m.course, m.rest = piece.time, piece.course, piece.rest
    m.until, m.piece = piece.until, piece.piece


@outlined
def turned_until(m: Any, t: float) -> float:
    """Time (s) in which the motion m (MOTION) turns at its first rate as far as until time t, see `turned_for`."""
    return turned_for(m.course, (m.vx, m.vy, m.vz), (m.ax, m.ay, m.az), t - m.time, m.rest - m.time)


@outlined
def rotation_at(m: Any, t: float, out: Any) -> None:
    """Write the rotation of the motion m (MOTION) at time t, exp((t - m.time) [w]x) R, into out (3, 3) (Rodrigues).

    On an arc, and after its rest, the time is that for which it has turned (`turned_for`).
    """
    R = m.rotation
    rate = sqrt(m.wx * m.wx + m.wy * m.wy + m.wz * m.wz)
    angle = rate * (t - m.time)
    if m.course != STRAIGHT:
        angle = rate * turned_until(m, t)
    if angle == 0.0:
        for i in range(3):
            for j in range(3):
                out[i, j] = R[i, j]
        return
    kx, ky, kz = m.wx / rate, m.wy / rate, m.wz / rate
    half_sine, half_cosine = sin_cos(0.5 * angle)
    c = 2.0 * half_sine * half_sine  # 1 - cos, without cancellation
    s = 2.0 * half_sine * half_cosine
    for j in range(3):
        x, y, z = R[0, j], R[1, j], R[2, j]
        ax, ay, az = ky * z - kz * y, kz * x - kx * z, kx * y - ky * x
        out[0, j] = x + s * ax + c * (ky * az - kz * ay)
        out[1, j] = y + s * ay + c * (kz * ax - kx * az)
        out[2, j] = z + s * az + c * (kx * ay - ky * ax)


@outlined
def place_at(m: Any, t: float) -> Place:
    """Where the motion m (MOTION) is at time t, relative to its place at m.time."""
    v, w, a = (m.vx, m.vy, m.vz), (m.wx, m.wy, m.wz), (m.ax, m.ay, m.az)
    return place_on(m.course, v, w, a, t - m.time, m.rest - m.time)


@inlined
def are_straight(A: Any, B: Any) -> bool:
    """Whether two motions are straight for ever, as most are: these need no call."""
    return A.course == STRAIGHT and B.course == STRAIGHT


@inlined
def position_at(m: Any, t: float) -> Vector:
    """Position of the motion m (MOTION) at time t (m)."""
    if m.course == STRAIGHT:
        s = t - m.time
        return (
            m.x + (m.vx + 0.5 * m.ax * s) * s,
            m.y + (m.vy + 0.5 * m.ay * s) * s,
            m.z + (m.vz + 0.5 * m.az * s) * s,
        )
    moved = place_at(m, t).moved
    return m.x + moved[0], m.y + moved[1], m.z + moved[2]


@inlined
def relative_position(A: Any, B: Any, t: float) -> Vector:
    """Position of motion B relative to motion A at time t (m). Positions are subtracted first, against round-off."""
    if not are_straight(A, B):
        return _bent_state(A, B, t).p
    ta, tb = t - A.time, t - B.time
    sa, sb = 0.5 * ta * ta, 0.5 * tb * tb
    return (
        B.x - A.x + (B.vx * tb - A.vx * ta) + (B.ax * sb - A.ax * sa),
        B.y - A.y + (B.vy * tb - A.vy * ta) + (B.ay * sb - A.ay * sa),
        B.z - A.z + (B.vz * tb - A.vz * ta) + (B.az * sb - A.az * sa),
    )


@inlined
def relative_velocity(A: Any, B: Any, t: float) -> Vector:
    """Velocity of motion B relative to motion A at time t (m/s)."""
    if not are_straight(A, B):
        return _bent_state(A, B, t).v
    ta, tb = t - A.time, t - B.time
    return (
        B.vx - A.vx + (B.ax * tb - A.ax * ta),
        B.vy - A.vy + (B.ay * tb - A.ay * ta),
        B.vz - A.vz + (B.az * tb - A.az * ta),
    )


class PairState(NamedTuple):
    """How two motions stand to each other at a time. World axes."""

    p: Any  # (3,): position of B's origin relative to A's (m)
    v: Any  # (3,): its velocity (m/s)
    w_a: Any  # (3,): angular velocities (rad/s)
    w_b: Any
    place_a: Any  # Place on the course; unused of two straight motions
    place_b: Any


@inlined
def pair_state(A: Any, B: Any, t: float) -> PairState:
    """How motions A and B stand to each other at time t."""
    w_a, w_b = (A.wx, A.wy, A.wz), (B.wx, B.wy, B.wz)
    if are_straight(A, B):
        here = Place((0.0, 0.0, 0.0), (0.0, 0.0, 0.0), 1.0)
        return PairState(relative_position(A, B, t), relative_velocity(A, B, t), w_a, w_b, here, here)
    return _bent_state(A, B, t)


@outlined
def _bent_state(A: Any, B: Any, t: float) -> PairState:
    """`pair_state` of two motions if at least one is not straight."""
    a, b = place_at(A, t), place_at(B, t)
    p = (
        B.x - A.x + (b.moved[0] - a.moved[0]),
        B.y - A.y + (b.moved[1] - a.moved[1]),
        B.z - A.z + (b.moved[2] - a.moved[2]),
    )
    w_a, w_b = scaled((A.wx, A.wy, A.wz), a.rate), scaled((B.wx, B.wy, B.wz), b.rate)
    return PairState(p, minus(b.velocity, a.velocity), w_a, w_b, a, b)


@inlined
def most_turning(m: Any, begin: float, end: float) -> float:
    """Largest angular speed (rad/s) of the motion m (MOTION) between two times (s)."""
    rate = sqrt(m.wx * m.wx + m.wy * m.wy + m.wz * m.wz)
    if m.course == STRAIGHT:
        return rate
    return rate * max(abs(place_at(m, begin).rate), abs(place_at(m, end).rate))


@inlined
def half_acceleration(A: Any, B: Any, begin: float, end: float) -> float:
    """Bound on half the acceleration of motion B relative to motion A between two times (m/s^2)."""
    if not are_straight(A, B):
        return 0.5 * (acceleration_within(A, begin, end) + acceleration_within(B, begin, end))
    x, y, z = B.ax - A.ax, B.ay - A.ay, B.az - A.az
    return 0.5 * sqrt(x * x + y * y + z * z)


@outlined
def acceleration_within(m: Any, begin: float, end: float) -> float:
    """Bound on the acceleration (m/s^2) of the origin of the motion m (MOTION) between two times (s)."""
    v, w, a = (m.vx, m.vy, m.vz), (m.wx, m.wy, m.wz), (m.ax, m.ay, m.az)
    return most_acceleration(m.course, v, w, a, begin - m.time, end - m.time, m.rest - m.time)


class PairChange(NamedTuple):
    """How the motions of two bodies change at a time, and in a span after it."""

    acceleration: Any  # (3,): of B's origin relative to A's at that time (m/s^2)
    jerk: Any  # bound on its change (m/s^3)
    turning_a: Any  # (3,): angular acceleration of A (rad/s^2)
    turning_b: Any


@outlined
def _change_at(m: Any, velocity: Vector, t: float, span: float) -> Change:
    v, w, a = (m.vx, m.vy, m.vz), (m.wx, m.wy, m.wz), (m.ax, m.ay, m.az)
    return change_on(m.course, v, w, a, t - m.time, m.rest - m.time, span, velocity)


@inlined
def change_at(A: Any, B: Any, state: PairState, t: float, span: float) -> PairChange:
    """How motions A and B change at time t, at which they are in a state, and in the span (s) after it.

    The span is within `smooth_until`.
    """
    if are_straight(A, B):
        return PairChange((B.ax - A.ax, B.ay - A.ay, B.az - A.az), 0.0, (0.0, 0.0, 0.0), (0.0, 0.0, 0.0))
    one, other = _change_at(A, state.place_a.velocity, t, span), _change_at(B, state.place_b.velocity, t, span)
    return PairChange(
        minus(other.acceleration, one.acceleration), one.jerk + other.jerk, one.turning, other.turning
    )  # fmt: skip


@inlined
def smooth_until(A: Any, B: Any, t: float) -> float:
    """Time up to which the acceleration does not jump from time t on: the next one at which a motion comes to rest."""
    if are_straight(A, B):
        return inf
    return min(A.rest if t < A.rest else inf, B.rest if t < B.rest else inf)


@device
def turn_quaternion(q: Any, i: int, wx: float, wy: float, wz: float, t: float, out: Any) -> None:
    """Write the orientation q[i] after t (s) at angular velocity w (rad/s, world frame) into out (4,)."""
    x, y, z, w = q[i, 0], q[i, 1], q[i, 2], q[i, 3]
    rate = sqrt(wx * wx + wy * wy + wz * wz)
    if rate * abs(t) == 0.0:
        out[0], out[1], out[2], out[3] = x, y, z, w
        return
    s, c = sin_cos(0.5 * rate * t)
    s /= rate
    ax, ay, az = s * wx, s * wy, s * wz
    out[0] = c * x + ax * w + ay * z - az * y
    out[1] = c * y - ax * z + ay * w + az * x
    out[2] = c * z + ax * y - ay * x + az * w
    out[3] = c * w - ax * x - ay * y - az * z


@inlined
def turn_between(a: Any, b: Any) -> Vector:
    """Rotation vector of the shortest turn from the pose a (7,) to the pose b, along the world's axes (rad)."""
    x, y, z, w = b[3], b[4], b[5], b[6]
    p, q, r, o = -a[3], -a[4], -a[5], a[6]
    tx, ty, tz = w * p + x * o + y * r - z * q, w * q - x * r + y * o + z * p, w * r + x * q - y * p + z * o
    tw = w * o - x * p - y * q - z * r
    if tw < 0.0:
        tx, ty, tz, tw = -tx, -ty, -tz, -tw
    sine = sqrt(tx * tx + ty * ty + tz * tz)
    factor = 2.0 * np.arctan2(sine, tw) / sine if sine > 0.0 else 2.0
    return factor * tx, factor * ty, factor * tz


@inlined
def chord_angle(ax: float, ay: float, az: float, aw: float, bx: float, by: float, bz: float, bw: float) -> float:
    """Upper bound on the angle (rad) between two unit quaternions; exact to second order for small angles."""
    dot = ax * bx + ay * by + az * bz + aw * bw
    sign = 1.0 if dot >= 0.0 else -1.0
    dx, dy, dz, dw = ax - sign * bx, ay - sign * by, az - sign * bz, aw - sign * bw
    chord = sqrt(dx * dx + dy * dy + dz * dz + dw * dw)  # = 2 sin(angle / 4)
    return 2.0 * chord * (1.0 + 0.056 * chord * chord)  # >= 4 asin(chord / 2) up to angle pi


@device
def swept_box(bodies: Any, i: int, begin: float, margin: float) -> Region:
    """Box that contains body i, its tube and spread, and `margin` (m), from `begin` until its cover time."""
    m = bodies.motion[i]
    sweep = 0.0 if bodies.static[i] else m.cover - begin
    half = m.radius + margin + m.tube_0 + m.spread_0 + (m.tube_1 + m.spread_1) * (begin - m.tube_time + sweep)
    if m.until < begin + sweep:
        return _swept_along_plan(bodies, m, begin, begin + sweep, half)
    return _swept(m, begin, sweep, half)


@inlined
def _swept(m: Any, begin: float, sweep: float, half: float) -> Region:
    """`swept_box` of one motion; half (m): by which it contains its origin."""
    if m.course != STRAIGHT:
        return _swept_by_pieces(m, begin, sweep, half)
    ahead = 0.5 * sweep
    middle = begin - m.time + ahead
    # a t^2 / 2: the mean of both ends, and half of their difference
    first, last = 0.25 * (middle - ahead) ** 2, 0.25 * (middle + ahead) ** 2
    between, bent = first + last, last - first
    return Region(
        m.x + middle * m.vx + between * m.ax,
        m.y + middle * m.vy + between * m.ay,
        m.z + middle * m.vz + between * m.az,
        half + ahead * abs(m.vx) + bent * abs(m.ax),
        half + ahead * abs(m.vy) + bent * abs(m.ay),
        half + ahead * abs(m.vz) + bent * abs(m.az),
    )  # fmt: skip


@device
def _swept_along_plan(bodies: Any, m: Any, begin: float, end: float, half: float) -> Region:
    """`swept_box` of a body that follows a plan: the box of all its pieces. m: the piece that holds first."""
    box, k = _swept(m, begin, max(m.until - begin, 0.0), half), m.piece
    while bodies.pieces[k].until < end:
        k += 1
        piece = bodies.pieces[k]
        first = max(piece.time, begin)
        box = hull_of_regions(box, _swept(piece, first, max(min(piece.until, end) - first, 0.0), half))
    return box


@outlined
def _swept_by_pieces(m: Any, begin: float, sweep: float, half: float) -> Region:
    """`swept_box` of a motion that bends: of the chords of its pieces, which leave them by a t^2 / 8 at most."""
    before = position_at(m, begin)
    least, most = before, before
    angle = most_turning(m, begin, begin + sweep) * sweep
    pieces = FEWEST_PIECES if angle < FEWEST_PIECES * PIECE else int(min(angle / PIECE, MOST_PIECES))
    for piece in range(1, pieces + 1):
        begins, ends = begin + sweep * (piece - 1) / pieces, begin + sweep * piece / pieces
        span = ends - begins
        bent = 0.125 * acceleration_within(m, begins, ends) * span * span
        after = position_at(m, ends)
        least = (
            min(least[0], min(before[0], after[0]) - bent),
            min(least[1], min(before[1], after[1]) - bent),
            min(least[2], min(before[2], after[2]) - bent),
        )
        most = (
            max(most[0], max(before[0], after[0]) + bent),
            max(most[1], max(before[1], after[1]) + bent),
            max(most[2], max(before[2], after[2]) + bent),
        )
        before = after
    return Region(
        0.5 * (least[0] + most[0]),
        0.5 * (least[1] + most[1]),
        0.5 * (least[2] + most[2]),
        half + 0.5 * (most[0] - least[0]),
        half + 0.5 * (most[1] - least[1]),
        half + 0.5 * (most[2] - least[2]),
    )


LATER: Final = 1e-12
"""Part of the time since a state by which a body that reverses is looked at later, if it stands at that moment."""


class Twist(NamedTuple):
    """How a body moves at a time. World axes."""

    moved: Any  # (3,): displacement of the origin since its state (m)
    velocity: Any  # (3,): m/s
    angular: Any  # (3,): rad/s
    change: Any  # of both, in parts of them per second (1/s); 0 on a straight course


@outlined
def twist_on(kind: int, v: Vector, w: Vector, a: Vector, t: float, rest: float) -> Twist:
    """How a body moves t (s) after its state, see `place_on`."""
    there = place_on(kind, v, w, a, t, rest)
    if there.rate == 0.0 and t < rest:  # it reverses at this moment: a rounding later it has a direction again
        there = place_on(kind, v, w, a, t * (1.0 + LATER), rest)
    change = speed_change(v, a) / there.rate if kind != STRAIGHT and there.rate != 0.0 else 0.0
    return Twist(there.moved, there.velocity, scaled(w, there.rate), change)


@outlined
def twist_at(m: Any, t: float) -> Twist:
    """How the motion m (MOTION) moves at time t."""
    v, w, a = (m.vx, m.vy, m.vz), (m.wx, m.wy, m.wz), (m.ax, m.ay, m.az)
    return twist_on(m.course, v, w, a, t - m.time, m.rest - m.time)
