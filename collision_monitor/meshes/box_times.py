"""Times until which a moving box stays apart from the eight boxes, or the eight triangles, of a moving block."""

from __future__ import annotations

from typing import Any

from numba import types
from numba.core import cgutils
from numba.extending import intrinsic

from collision_monitor._jit import device, inlined
from collision_monitor._jit.lanes import Lanes, store
from collision_monitor.meshes.approach import STRETCH, Approach
from collision_monitor.meshes.boxes import Block, half_of, inner, seen_from
from collision_monitor.meshes.layout import AXES, CENTER, CORNERS, HALF, RADIUS
from collision_monitor.meshes.placing import turned_back


def norm(a: list[Lanes]) -> Lanes:
    """Lengths of eight vectors."""
    return inner(a, a).root()


def _cross(a: list[Lanes], b: list[Lanes]) -> list[Lanes]:
    return [a[(k + 1) % 3] * b[(k + 2) % 3] - a[(k + 2) % 3] * b[(k + 1) % 3] for k in range(3)]


def times_until(gap: Lanes, speed: Lanes, curvatures: tuple[Lanes, Lanes, Lanes], until: Lanes) -> Lanes:
    """Times until which eight gaps stay open. curvatures: the largest of any time, that now, its change per second."""
    zero, tiny = Lanes.constant(gap.builder, 0.0), Lanes.constant(gap.builder, 1e-300)
    largest, bent, change = curvatures
    gap = gap.largest(zero)

    def time(curvature: Lanes) -> Lanes:  # `time_until`
        root = (speed * speed + (curvature + curvature) * gap).root()
        closing = (gap + gap) / (speed + root).largest(tiny)
        opening = (root - speed).largest(tiny) / curvature
        return closing.where(speed, opening).where(gap, zero)

    first = time(largest)
    later = (first * Lanes.constant(gap.builder, STRETCH)).least(until)
    within = bent + later * change * Lanes.constant(gap.builder, 1.0 / 3.0)
    return first.largest(later.least(time(largest.least(within.largest(zero)))))


class _Motion:
    """The numbers of an Approach in every lane, while a kernel is compiled."""

    def __init__(self, builder: Any, move: Any) -> None:
        def number(value: Any) -> Lanes:
            return Lanes.constant(builder, value)

        fields = cgutils.unpack_tuple(builder, move)
        vectors = [[number(each) for each in cgutils.unpack_tuple(builder, field)] for field in fields[:4]]
        self.v, self.a, self.w_a, self.w_b = vectors
        self._bends, self._jerks = [number(each) for each in fields[4:7]], [number(each) for each in fields[7:10]]
        self.start, self.growth, self.until = (number(each) for each in fields[10:])

    def times(self, n: list[Lanes], gap: Lanes, a: _Reach, b: _Reach) -> Lanes:
        """Times until which gaps (m) along n stay open."""
        k, m = _cross(n, self.w_a), _cross(n, self.w_b)
        speed = a.most(k) + b.most([b.zero - each for each in m]) - inner(n, self.v) + self.growth
        u_a, u_b = _cross(k, self.w_a), _cross(m, self.w_b)
        bent = a.most(u_a) + b.most([b.zero - each for each in u_b]) - inner(n, self.a)
        largest, change = (
            origin + of_a * a.radius + of_b * b.radius for of_a, of_b, origin in (self._bends, self._jerks)
        )
        return times_until(gap - self.start, speed, (largest, bent, change), self.until)


class _Reach:
    """Eight boxes or triangles about the origin of their tree: how far they extend."""

    def __init__(self, zero: Lanes, points: list[list[Lanes]], half: list[Lanes], axes: list[list[Lanes]]) -> None:
        """points: the centre of a box, or the corners of a triangle; half, axes: of the box, none for a triangle."""
        self.zero, self._points, self._half, self._axes = zero, points, half, axes
        lengths = [norm(point) for point in points]
        self.radius = lengths[0] + norm(half) if half else lengths[0].largest(lengths[1]).largest(lengths[2])

    def most(self, d: list[Lanes]) -> Lanes:
        """Largest d . x of their points x."""
        far = inner(self._points[0], d)
        for point in self._points[1:]:
            far = far.largest(inner(point, d))
        return far + inner([abs(inner(axis, d)) for axis in self._axes], self._half) if self._half else far


@intrinsic
def _box_times(typing_context, half, M, center, move, blocks, block, out, at):
    signature = types.void(half, M, center, move, blocks, types.int64, out, types.int64)

    def codegen(context, builder, signature, arguments):
        def vectors(k: int) -> list[Lanes]:
            return [Lanes.constant(builder, each) for each in cgutils.unpack_tuple(builder, arguments[k])]

        zero, one = Lanes.constant(builder, 0.0), Lanes.constant(builder, 1.0)
        e, M, own = vectors(0), vectors(1), vectors(2)
        members = Block(context, builder, signature.args[4], arguments[4], arguments[5])
        axes, f = members.matrix(AXES), members.vector(HALF)
        R = [[inner(M[3 * r : 3 * r + 3], [axes[k][c] for k in range(3)]) for c in range(3)] for r in range(3)]
        columns = [[R[r][c] for r in range(3)] for c in range(3)]
        arm = [inner(M[3 * r : 3 * r + 3], members.vector(CENTER)) for r in range(3)]  # from B's origin
        x = [arm[r] + M[9 + r] for r in range(3)]
        size = [[abs(R[r][c]) for c in range(3)] for r in range(3)]

        def gaps(x: list[Lanes], own: list[Lanes], shadow: list[Lanes]) -> list[Lanes]:
            """Gap vector from the first box to the second."""
            open_ = [(abs(x[k]) - own[k] - shadow[k]).largest(zero) for k in range(3)]
            return [open_[k].where(x[k], zero - open_[k]) for k in range(3)]

        g = gaps(x, e, [inner(size[r], f) for r in range(3)])
        y = [inner(column, x) for column in columns]
        h = gaps(y, f, [inner([size[r][c] for r in range(3)], e) for c in range(3)])
        h = [inner(R[r], h) for r in range(3)]
        better = inner(g, g) - inner(h, h)
        w = [g[k].where(better, h[k]) for k in range(3)]
        length, far, tiny = norm(w), norm(x), Lanes.constant(builder, 1e-300)
        n = [each / length.largest(tiny) for each in w]
        gap = inner(n, x) - inner([abs(each) for each in n], e)
        gap = gap - inner([abs(inner(column, n)) for column in columns], f)
        # the line of both centres is often better, and takes little more
        wide = far - (inner([abs(each) for each in x], e) + inner([abs(each) for each in y], f)) / far.largest(tiny)
        n = [(x[k] / far.largest(tiny)).where(wide - gap, n[k]) for k in range(3)]
        gap = wide.largest(gap)
        unit = [[one if r == c else zero for r in range(3)] for c in range(3)]
        a, b = _Reach(zero, [own], e, unit), _Reach(zero, [arm], f, columns)
        time = _Motion(builder, arguments[3]).times(n, gap, a, b)
        store(context, builder, time, signature.args[6], arguments[6], arguments[7])
        return context.get_dummy_value()

    return signature, codegen


@intrinsic
def _triangle_times(typing_context, half, M, center, move, blocks, block, out, at):
    signature = types.void(half, M, center, move, blocks, types.int64, out, types.int64)

    def codegen(context, builder, signature, arguments):
        def vectors(k: int) -> list[Lanes]:
            return [Lanes.constant(builder, each) for each in cgutils.unpack_tuple(builder, arguments[k])]

        zero, one = Lanes.constant(builder, 0.0), Lanes.constant(builder, 1.0)
        e, M, own = vectors(0), vectors(1), vectors(2)
        members = Block(context, builder, signature.args[4], arguments[4], arguments[5])
        corners, radius = [members.vector(CORNERS + 3 * i) for i in range(3)], members.row(RADIUS)
        arms = [[inner(M[3 * r : 3 * r + 3], corner) for r in range(3)] for corner in corners]  # from B's origin
        w = []
        for r in range(3):
            x, y, z = (arm[r] + M[9 + r] for arm in arms)
            above = (x.least(y).least(z) - radius - e[r]).largest(zero)
            w.append(above + (x.largest(y).largest(z) + radius + e[r]).least(zero))
        gap = norm(w)
        n = [each / gap.largest(Lanes.constant(builder, 1e-300)) for each in w]
        unit = [[one if r == c else zero for r in range(3)] for c in range(3)]
        box, triangle = _Reach(zero, [own], e, unit), _Reach(zero, arms, [], [])
        time = _Motion(builder, arguments[3]).times(n, gap, box, triangle)
        store(context, builder, time, signature.args[6], arguments[6], arguments[7])
        return context.get_dummy_value()

    return signature, codegen


@inlined
def _turned(blocks_a, a, member, move):
    """Centre of a box, and a motion, in the axes of the box."""
    center = blocks_a[a, CENTER, member], blocks_a[a, CENTER + 1, member], blocks_a[a, CENTER + 2, member]
    return turned_back(blocks_a, a, member, center), Approach(
        turned_back(blocks_a, a, member, move.v),
        turned_back(blocks_a, a, member, move.a),
        turned_back(blocks_a, a, member, move.w_a),
        turned_back(blocks_a, a, member, move.w_b),
        move.bend_a,
        move.bend_b,
        move.bend,
        move.jerk_a,
        move.jerk_b,
        move.jerk,
        move.start,
        move.growth,
        move.until,
    )


@device
def box_times(blocks_a, a, member, blocks_b, b, X, move, out, at):
    """Write times until which a box stays apart from the eight boxes of block b to out[at: at + 8] (s).

    blocks_a, a, member: the box. X: pose of the tree of b in the frame of the box's tree; move (Approach): in its axes.
    """
    own, turned = _turned(blocks_a, a, member, move)
    _box_times(half_of(blocks_a, a, member), seen_from(blocks_a, a, member, X), own, turned, blocks_b, b, out, at)


@device
def triangle_times(blocks_a, a, member, blocks_b, b, X, move, out, at):
    """As `box_times`, for the triangles of block b."""
    own, turned = _turned(blocks_a, a, member, move)
    _triangle_times(half_of(blocks_a, a, member), seen_from(blocks_a, a, member, X), own, turned, blocks_b, b, out, at)
