"""Times until which boxes and triangles of two moving trees stay apart: bounds along their separating directions.

Along a unit direction n from A to B, a point at x in a body that turns at w moves by n.(v + w x x) per second now, and
accelerates by at most |a| + |w|^2 |x|. So a gap g along n that closes at most at the speed s stays open until
g - s d - c d^2 / 2 = 0. (Mirtich, 1996; Tang, Kim, Manocha, C2A, 2009)
"""

from __future__ import annotations

from math import inf, sqrt
from typing import Any, NamedTuple

from numba import types
from numba.core import cgutils
from numba.extending import intrinsic

from collision_monitor._jit import device, inlined
from collision_monitor._jit.lanes import Lanes, store
from collision_monitor.meshes.boxes import Block, half_of, inner, seen_from
from collision_monitor.meshes.layout import AXES, CENTER, HALF
from collision_monitor.meshes.placing import turned_back
from collision_monitor.meshes.triangle_pair import Triangle
from collision_monitor.narrow_phase.vector import Vector, cross, dot, minus


class Approach(NamedTuple):
    """How two trees move now, in the axes of one of them, A. m, s, rad.

    v: velocity of B's origin relative to A's. w_a, w_b: angular velocities. bend_a, bend_b: |w|^2. bend: what the
    origins' acceleration and the distances of the trees' origins from those of their bodies add to the curvature.
    start, growth: gap that counts as contact now, and its growth per second.
    """

    v: Vector
    w_a: Vector
    w_b: Vector
    bend_a: Any
    bend_b: Any
    bend: Any
    start: Any
    growth: Any


@inlined
def time_until(gap: float, speed: float, curvature: float) -> float:
    """Largest time until which gap - speed d - curvature d^2 / 2 stays at least 0; 0 if the gap is not open."""
    if not gap > 0.0:
        return 0.0
    root = sqrt(speed * speed + 2.0 * curvature * gap)
    if speed > 0.0:
        return 2.0 * gap / (speed + root)
    return (root - speed) / curvature if curvature > 0.0 else inf


@device
def time_along(S: Triangle, T: Triangle, n: Vector, radius: float, at: Vector, move: Approach) -> float:
    """Time until which two triangles stay `radius` (m) apart along a direction n; at: B's origin in A's frame (m)."""
    k, m = cross(n, move.w_a), cross(n, move.w_b)
    far = max(dot(S.a, n), max(dot(S.b, n), dot(S.c, n)))
    near = min(dot(T.a, n), min(dot(T.b, n), dot(T.c, n)))
    p, q, r = minus(T.a, at), minus(T.b, at), minus(T.c, at)
    forth = max(dot(S.a, k), max(dot(S.b, k), dot(S.c, k)))
    back = min(dot(p, m), min(dot(q, m), dot(r, m)))
    # the spheres about the corners turn with them, which does not move their surfaces
    reach_a = sqrt(max(dot(S.a, S.a), max(dot(S.b, S.b), dot(S.c, S.c))))
    reach_b = sqrt(max(dot(p, p), max(dot(q, q), dot(r, r))))
    curvature = move.bend + move.bend_a * reach_a + move.bend_b * reach_b
    return time_until(near - far - radius - move.start, forth - back - dot(n, move.v) + move.growth, curvature)


def _norm(a: list[Lanes]) -> Lanes:
    return inner(a, a).root()


def _cross(a: list[Lanes], b: list[Lanes]) -> list[Lanes]:
    return [a[(k + 1) % 3] * b[(k + 2) % 3] - a[(k + 2) % 3] * b[(k + 1) % 3] for k in range(3)]


@intrinsic
def _times(typing_context, half, M, center, move, blocks, block, out, at):
    signature = types.void(half, M, center, move, blocks, types.int64, out, types.int64)

    def codegen(context, builder, signature, arguments):
        def number(value: Any) -> Lanes:
            return Lanes.constant(builder, value)

        zero, tiny = number(0.0), number(1e-300)
        e = [number(each) for each in cgutils.unpack_tuple(builder, arguments[0])]
        M = [number(each) for each in cgutils.unpack_tuple(builder, arguments[1])]
        own = [number(each) for each in cgutils.unpack_tuple(builder, arguments[2])]
        fields = cgutils.unpack_tuple(builder, arguments[3])
        v, w_a, w_b = ([number(each) for each in cgutils.unpack_tuple(builder, field)] for field in fields[:3])
        bend_a, bend_b, bend, start, growth = (number(field) for field in fields[3:])
        members = Block(context, builder, signature.args[4], arguments[4], arguments[5])
        axes, f = members.matrix(AXES), members.vector(HALF)
        R = [[inner(M[3 * r : 3 * r + 3], [axes[k][c] for k in range(3)]) for c in range(3)] for r in range(3)]
        shift = M[9:12]
        arm = [inner(M[3 * r : 3 * r + 3], members.vector(CENTER)) for r in range(3)]  # from B's origin
        x = [arm[r] + shift[r] for r in range(3)]
        size = [[abs(R[r][c]) for c in range(3)] for r in range(3)]

        def gaps(x: list[Lanes], own: list[Lanes], shadow: list[Lanes]) -> list[Lanes]:
            """Gap vector from the first box to the second."""
            open_ = [(abs(x[k]) - own[k] - shadow[k]).largest(zero) for k in range(3)]
            return [open_[k].where(x[k], zero - open_[k]) for k in range(3)]

        g = gaps(x, e, [inner(size[r], f) for r in range(3)])
        y = [inner([R[r][c] for r in range(3)], x) for c in range(3)]
        h = gaps(y, f, [inner([size[r][c] for r in range(3)], e) for c in range(3)])
        h = [inner(R[r], h) for r in range(3)]
        better = inner(g, g) - inner(h, h)
        w = [g[k].where(better, h[k]) for k in range(3)]
        gap = _norm(w)
        n = [each / gap.largest(tiny) for each in w]
        k, m = _cross(n, w_a), _cross(n, w_b)
        along = [inner([R[r][c] for r in range(3)], m) for c in range(3)]
        speed = inner(own, k) + inner([abs(each) for each in k], e) - inner(arm, m)
        speed = speed + inner([abs(each) for each in along], f) - inner(n, v) + growth
        curvature = bend + bend_a * (_norm(own) + _norm(e)) + bend_b * (_norm(arm) + _norm(f))
        gap = (gap - start).largest(zero)
        root = (speed * speed + (curvature + curvature) * gap).root()
        closing = (gap + gap) / (speed + root).largest(tiny)
        opening = (root - speed).largest(tiny) / curvature
        time = closing.where(speed, opening).where(gap, zero)
        store(context, builder, time, signature.args[6], arguments[6], arguments[7])
        return context.get_dummy_value()

    return signature, codegen


@device
def box_times(blocks_a, a, member, blocks_b, b, X, move, out, at):
    """Write times until which a box stays apart from the eight boxes of block b to out[at: at + 8] (s).

    blocks_a, a, member: the box. X: pose of the tree of b in the frame of the box's tree; move (Approach): in its axes.
    """
    center = blocks_a[a, CENTER, member], blocks_a[a, CENTER + 1, member], blocks_a[a, CENTER + 2, member]
    turned_move = Approach(
        turned_back(blocks_a, a, member, move.v),
        turned_back(blocks_a, a, member, move.w_a),
        turned_back(blocks_a, a, member, move.w_b),
        move.bend_a,
        move.bend_b,
        move.bend,
        move.start,
        move.growth,
    )
    own = turned_back(blocks_a, a, member, center)
    _times(half_of(blocks_a, a, member), seen_from(blocks_a, a, member, X), own, turned_move, blocks_b, b, out, at)
