"""Motions of links whose joints are polynomials in time, as pieces of plans whose tubes are certified.

Between two poses that forward kinematics gives, a link follows an arc: a constant twist in its own frame. How far a
point of the link is off that arc is a smooth function of time, known at five nodes. The quartic through them is bounded
by its Bernstein coefficients (Farouki, 2012), and the rest by the fifth derivative of the chain: each joint turns all
that it carries, so the n-th derivative of a point is at most the sum over the segments of the chain of their length
times the n-th power of the rates before them (as the motion bounds of Schwarzer, Saha and Latombe, 2005, for the first
one). Where rates change, the power becomes the n-th complete Bell polynomial of the sums of the joints' derivatives
(Faa di Bruno). A link that one joint alone moves, at a constant rate, is on its arc.
Cubic Hermite curves in place of arcs were tried: they need fewer pieces for one link of ten.
"""

from __future__ import annotations

from math import sqrt
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from collision_monitor._jit import device, inlined, kernel
from collision_monitor.geometry.vector import Vector, magnitude, scaled
from collision_monitor.motion.course import ARC, STRAIGHT, bends, place_on, screw_velocity
from collision_monitor.motion.motion import quaternion_to_matrix, turn_between
from collision_monitor.motion.trigonometry import sin_cos
from collision_monitor.robots.joint_motion import NODES, JointSpans
from collision_monitor.robots.kinematic_tree import SLIDING, TURNING, KinematicTree
from collision_monitor.robots.link_motions import link_motions

Floats = NDArray[np.float64]

MOST_TURN: Final = 2.5
"""rad by which a body turns in a piece: the shortest turn between two poses is its own up to pi."""

REST: Final = 2.96e-5
"""Largest distance of a function from the quartic through five even nodes of [0, 1], for a fifth derivative of 1."""

ARC_POWER: Final = 4
"""The fifth derivative of an arc is its speed times this power of its angular speed."""


AT_REST: Final = (0.0, 0.0, 0.0)


class Wanted(NamedTuple):
    """The bodies whose pieces are wanted."""

    rows: Any  # (B,) int64: of the tree
    radii: Any  # (B,): of a sphere about the origin of the row that holds the body (m)


class BaseBound(NamedTuple):
    """How the base link moves: on one of the courses of course.py, without an acceleration."""

    speed: float  # m/s
    turning: float  # rad/s
    screws: float  # 0: it stands; 1: its motion is one screw; 2: it is not


class ChainBounds(NamedTuple):
    """Bounds on the motion of L links in each of S spans."""

    turning: Any  # (S, L, 5): angular speed (rad/s) and its first four derivatives
    turned: Any  # (S, L): fifth derivative of the rotation (1/s^5)
    fifth: Any  # (S, L): fifth derivative of the origin (m/s^5)
    screws: Any  # (S, L): number of joints that move it; one whose rate changes counts twice


class LinkPieces(NamedTuple):
    """For each of B bodies the points of its plan, as nodes."""

    points: Any  # (B, most) int32: nodes at the ends of its pieces
    counts: Any  # (B,) int32: of its points
    tubes: Any  # (B,): m by which it may be off what lies between its points
    poses: Any  # (N, L, 7): of all links at all nodes


def link_pieces(
    tree: KinematicTree, wanted: Wanted, spans: JointSpans, base: Floats, bound: BaseBound, tolerance: float
) -> LinkPieces:
    """The plans of some links. base (N, 13): motion of the base link at the nodes.

    tolerance (m): tubes are narrower, unless a link moves too fast for MOST_PIECES.
    """
    poses, _ = link_motions(tree.table, spans.joints, base)
    count, most = len(wanted.rows), (len(spans.times) - len(spans.first) + 1) // NODES + 1
    shape = len(spans.first) - 1, len(tree.links)
    bounds = ChainBounds(np.zeros((*shape, 5)), np.zeros(shape), np.zeros(shape), np.zeros(shape))
    found = LinkPieces(np.zeros((count, most), np.int32), np.zeros(count, np.int32), np.zeros(count), poses)
    _choose_pieces(tree.table, wanted, spans, bound, float(tolerance), bounds, found, np.zeros((5, 3, 3)))
    return found


@kernel
def _choose_pieces(
    table: Any, wanted: Any, spans: Any, base: Any, tolerance: float, bounds: Any, found: Any, work: Any
) -> None:
    for s in range(len(spans.first) - 1):
        _bound_span(table, spans, base, s, bounds)
    for b in range(len(wanted.rows)):
        _cut(b, wanted, spans, bounds, found, tolerance, work)


@device
def _bound_span(table: Any, spans: Any, base: Any, s: int, bounds: Any) -> None:
    """Bound the derivatives of all links in a span: of a product of rotations and of segments that slide."""
    turning, fifth, screws = bounds.turning[s], bounds.fifth[s], bounds.screws[s]
    turning[0, 0], screws[0] = base.turning, base.screws
    fifth[0] = base.speed * base.turning**ARC_POWER
    bounds.turned[s, 0] = _bell(turning[0])[5]
    for i in range(1, len(table.parent)):
        above, j = table.parent[i], table.variable[i]
        bell = _bell(turning[above])
        x, y, z = table.position[i]
        fifth[i], screws[i] = fifth[above] + bell[5] * sqrt(x * x + y * y + z * z), screws[above]
        for k in range(5):
            turning[i, k] = turning[above, k]
        if j >= 0:
            factor, joint = abs(table.multiplier[i]), spans.bounds[s, j]
            if joint[1] > 0.0:
                screws[i] += 1.0 if joint[2] == joint[3] == joint[4] == joint[5] == 0.0 else 2.0
            if table.kind[i] == SLIDING:
                fifth[i] += bell[5] * (factor * joint[0] + abs(table.offset[i])) + factor * (
                    5.0 * bell[4] * joint[1] + 10.0 * bell[3] * joint[2] + 10.0 * bell[2] * joint[3]
                    + 5.0 * bell[1] * joint[4] + joint[5]
                )  # fmt: skip
            if table.kind[i] == TURNING:
                for k in range(5):
                    turning[i, k] += factor * joint[k + 1]
        bounds.turned[s, i] = _bell(turning[i])[5]


@inlined
def _bell(x: Any) -> tuple[float, float, float, float, float, float]:
    """The complete Bell polynomials 0 to 5 of x (5,)."""
    a, b, c, d, e = x[0], x[1], x[2], x[3], x[4]
    second, third = a * a + b, a * a * a + 3.0 * a * b + c
    fourth = a**4 + 6.0 * a * a * b + 4.0 * a * c + 3.0 * b * b + d
    fifth = a**5 + 10.0 * b * a**3 + 15.0 * b * b * a + 10.0 * c * a * a + 10.0 * c * b + 5.0 * d * a + e
    return 1.0, a, second, third, fourth, fifth


@device
def _cut(b: int, wanted: Any, spans: Any, bounds: Any, found: Any, tolerance: float, work: Any) -> None:
    """Write the nodes between the fewest arcs of body b, by halves, and its tube."""
    i, r = wanted.rows[b], wanted.radii[b]
    n, tube, last = 0, 0.0, 0
    for s in range(len(spans.first) - 1):
        first, last = spans.first[s], spans.first[s + 1] - 1
        limits = (bounds.turning[s, i, 0], bounds.turned[s, i], bounds.fifth[s, i], bounds.screws[s, i])
        k, size = first, last - first
        while k < last:
            off = _error(i, r, k, size, spans.times, limits, found.poses, tolerance, work)
            while size > NODES and not off <= tolerance:
                size //= 2
                off = _error(i, r, k, size, spans.times, limits, found.poses, tolerance, work)
            found.points[b, n] = k
            n, k, tube = n + 1, k + size, max(tube, off)
            if (k - first) % (2 * size) == 0 and k + 2 * size <= last:
                size *= 2
    found.points[b, n] = last
    found.counts[b], found.tubes[b] = n + 1, tube


@device
def _error(
    i: int, r: float, k: int, size: int, times: Any, limits: Any, poses: Any, tolerance: float, work: Any
) -> float:  # fmt: skip
    """How far (m) the points within r of link i are off the arc between the nodes k and k + size.

    limits: angular speed, fifth derivatives of rotation and origin, and number of screws. An arc of several shortest
    pieces that is off by more than the tolerance for a simple reason is not measured further.
    """
    turning, turned, fifth, screws = limits
    h = times[k + size] - times[k]
    if screws <= 1.0 and turning * h <= MOST_TURN:
        return 0.0
    a, b = poses[k, i], poses[k + size, i]
    moved, turn = (b[0] - a[0], b[1] - a[1], b[2] - a[2]), turn_between(a, b)
    shift = screw_velocity(moved, turn)
    course = ARC if bends(shift, turn) else STRAIGHT
    v, w = scaled(shift, 1.0 / h), scaled(turn, 1.0 / h)
    spin = magnitude(w)
    rest = REST * h**5 * (fifth + turned * r + spin**4 * (spin * r + magnitude(v)))
    if size > NODES and not rest <= tolerance:
        return float(rest)
    middle = k + size // 2
    gone = place_on(course, v, w, AT_REST, times[middle] - times[k], np.inf).moved
    p = (
        poses[middle, i, 0] - a[0] - gone[0],
        poses[middle, i, 1] - a[1] - gone[1],
        poses[middle, i, 2] - a[2] - gone[2],
    )
    if size > NODES and not magnitude(p) <= tolerance:
        return magnitude(p)
    quaternion_to_matrix(poses[:, i, 3:], k, work[0])
    off1, off2, off3 = AT_REST, AT_REST, AT_REST
    for node in range(1, 4):
        at = k + node * size // 4
        s = times[at] - times[k]
        gone = place_on(course, v, w, AT_REST, s, np.inf).moved
        off = (poses[at, i, 0] - a[0] - gone[0], poses[at, i, 1] - a[1] - gone[1], poses[at, i, 2] - a[2] - gone[2])
        off1, off2, off3 = (off if node == 1 else off1), (off if node == 2 else off2), (off if node == 3 else off3)
        quaternion_to_matrix(poses[:, i, 3:], at, work[node])
        _subtract_turned(w, s, work[0], work[node])
    most = max(
        magnitude(_combined(off1, off2, off3, 4.0, -3.0, 4.0 / 3.0)) + r * _size(work, 4.0, -3.0, 4.0 / 3.0),
        magnitude(_combined(off1, off2, off3, -32.0 / 9.0, 20.0 / 3.0, -32.0 / 9.0))
        + r * _size(work, -32.0 / 9.0, 20.0 / 3.0, -32.0 / 9.0),
        magnitude(_combined(off1, off2, off3, 4.0 / 3.0, -3.0, 4.0)) + r * _size(work, 4.0 / 3.0, -3.0, 4.0),
    )
    return float(most + rest)


@inlined
def _combined(a: Vector, b: Vector, c: Vector, x: float, y: float, z: float) -> Vector:
    """A Bernstein coefficient of the quartic that is 0 at both ends and a, b, c at its inner nodes."""
    return x * a[0] + y * b[0] + z * c[0], x * a[1] + y * b[1] + z * c[1], x * a[2] + y * b[2] + z * c[2]


@device
def _size(work: Any, x: float, y: float, z: float) -> float:
    """Bound on the largest stretch of the matrix x D1 + y D2 + z D3: the fourth root of the trace of (M'M)^2."""
    for r in range(3):
        for c in range(3):
            work[4, r, c] = x * work[1, r, c] + y * work[2, r, c] + z * work[3, r, c]
    total = 0.0
    for a in range(3):
        for b in range(3):
            entry = work[4, 0, a] * work[4, 0, b] + work[4, 1, a] * work[4, 1, b] + work[4, 2, a] * work[4, 2, b]
            total += entry * entry
    return sqrt(sqrt(total))


@device
def _subtract_turned(w: Vector, s: float, R: Any, out: Any) -> None:
    """Subtract the rotation R, turned for s (s) at w (rad/s), from the matrix `out` (Rodrigues)."""
    rate = magnitude(w)
    half_sine, half_cosine = sin_cos(0.5 * rate * s)
    one, two = 0.0, 0.0
    if rate > 0.0:
        one, two = 2.0 * half_sine * half_cosine / rate, 2.0 * half_sine * half_sine / (rate * rate)
    for j in range(3):
        x, y, z = R[0, j], R[1, j], R[2, j]
        ax, ay, az = w[1] * z - w[2] * y, w[2] * x - w[0] * z, w[0] * y - w[1] * x
        out[0, j] -= x + one * ax + two * (w[1] * az - w[2] * ay)
        out[1, j] -= y + one * ay + two * (w[2] * ax - w[0] * az)
        out[2, j] -= z + one * az + two * (w[0] * ay - w[1] * ax)
