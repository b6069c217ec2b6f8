"""Times until which a moving box stays apart from the eight boxes of a moving block."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from numba import types
from numba.core import cgutils
from numba.extending import intrinsic

from collision_monitor._jit import device, inlined
from collision_monitor._jit.lanes import Lanes, store
from collision_monitor.meshes.advance.approach import STRETCH, Approach
from collision_monitor.meshes.boxes import Block, inner, seen_from
from collision_monitor.meshes.layout import AXES, CENTER, REACH, ROWS, WIDTH
from collision_monitor.meshes.placing import turned_back
from collision_monitor.meshes.supports import Supports


def norm(a: list[Lanes]) -> Lanes:
    """Lengths of eight vectors."""
    return inner(a, a).root()


def _cross(a: list[Lanes], b: list[Lanes]) -> list[Lanes]:
    return [a[(k + 1) % 3] * b[(k + 2) % 3] - a[(k + 2) % 3] * b[(k + 1) % 3] for k in range(3)]


def times_open(gap: Lanes, speed: Lanes, curvature: Lanes) -> Lanes:
    """`time_until` of eight gaps."""
    zero, tiny = Lanes.constant(gap.builder, 0.0), Lanes.constant(gap.builder, 1e-300)
    gap = gap.largest(zero)
    root = (speed * speed + (curvature + curvature) * gap).root()
    length = (gap + gap).where(speed, (root - speed).largest(tiny))
    return (length / (speed + root).where(speed, curvature)).where(gap, zero)


def curvature_until(until: Lanes, largest: Lanes, bent: Lanes, change: Lanes) -> Lanes:
    """Largest curvature within a time, from the largest of any time, that now, and its change per second."""
    within = bent + until * change * Lanes.constant(until.builder, 1.0 / 3.0)
    return largest.least(within.largest(Lanes.constant(until.builder, 0.0)))


class _Motion:
    """The numbers of an Approach in every lane, while a kernel is compiled."""

    def __init__(self, builder: Any, move: Any) -> None:
        def number(value: Any) -> Lanes:
            return Lanes.constant(builder, value)

        fields = cgutils.unpack_tuple(builder, move)
        vectors = [[number(each) for each in cgutils.unpack_tuple(builder, field)] for field in fields[:4]]
        self.v, self.a, self.w_a, self.w_b = vectors
        self._largest, self._change = number(fields[6]), number(fields[9])
        self.start, self.growth, self.until = (number(each) for each in fields[10:])

    def times(self, n: list[Lanes], reach: Lanes, gap: Lanes, a: _Boxes, b: _Boxes) -> Lanes:
        """Times until which gaps (m) along n stay open. reach: how far both boxes reach along n from their centres."""
        gap, back = gap - self.start, _negative(n)
        k, m = _cross(n, self.w_a), _cross(back, self.w_b)
        u_a, u_b = _cross(k, self.w_a), _cross(m, self.w_b)
        center_speed = a.center_along(k) + b.center_along(m) - inner(n, self.v) + self.growth
        bent = a.center_along(u_a) + a.flat_reach(u_a) + b.center_along(u_b) + b.flat_reach(u_b) - inner(n, self.a)
        first = times_open(gap, center_speed + a.flat_reach(k) + b.flat_reach(m), self._largest)
        later = (first * Lanes.constant(gap.builder, STRETCH)).least(self.until)
        # what reaches farthest along n is not what moves fastest along it: until then, the largest n . x + k . x t over
        # the points x of a box stays below the chord of its values now and then, because it is convex in t
        far = a.reach(_ahead(n, k, later)) + b.reach(_ahead(back, m, later))
        speed = center_speed + (far - reach) / later
        longer = times_open(gap, speed, curvature_until(later, self._largest, bent, self._change))
        return later.least(longer).largest(first)  # also if `later` is 0, without a quotient


class _Boxes:
    """Eight boxes in the axes of the one that all lanes share, with their centres from the origin of their tree."""

    def __init__(self, supports: Supports, center: list[Lanes], axes: list[list[Lanes]] | None) -> None:
        """axes: of the boxes, if others."""
        self._supports, self._center, self._axes = supports, center, axes

    def reach(self, d: list[Lanes]) -> Lanes:
        """Bound on the largest d . x of their points x from their centres."""
        return self._supports.reach(self._turned(d))

    def _turned(self, d: list[Lanes]) -> list[Lanes]:
        return [inner(axis, d) for axis in self._axes] if self._axes else d

    def center_along(self, d: list[Lanes]) -> Lanes:
        """d . x of their centres x, from the origin of their tree."""
        return inner(self._center, d)

    def flat_reach(self, d: list[Lanes]) -> Lanes:
        """As `reach`, of the whole boxes: looser, and computed in a third of the time."""
        return inner([abs(each) for each in self._turned(d)], self._supports.half)


def _ahead(n: list[Lanes], k: list[Lanes], t: Lanes) -> list[Lanes]:
    """n + t k."""
    return [n[i].plus_product(k[i], t) for i in range(3)]


def _negative(a: list[Lanes]) -> list[Lanes]:
    zero = Lanes.constant(a[0].builder, 0.0)
    return [zero - each for each in a]


def _rows_of(context: Any, builder: Any, array_type: Any, array: Any, place: Any) -> Callable[[int], Lanes]:
    """The rows of one box, WIDTH * block + member, in every lane."""
    shift = place.type(WIDTH.bit_length() - 1)
    block, member = builder.ashr(place, shift), builder.and_(place, place.type(WIDTH - 1))
    first = builder.add(builder.mul(block, block.type(ROWS * WIDTH)), member)
    data = context.make_array(array_type)(context, builder, array).data

    def row(k: int) -> Lanes:
        return Lanes.constant(builder, builder.load(builder.gep(data, [builder.add(first, first.type(WIDTH * k))])))

    return row


@intrinsic
def _box_times(
    typing_context: Any, blocks_a: Any, place: Any, M: Any, center: Any, move: Any, blocks: Any, block: Any, out: Any,
    at: Any,
) -> Any:  # fmt: skip
    signature = types.void(blocks_a, types.int64, M, center, move, blocks, types.int64, out, types.int64)

    def codegen(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        def vectors(k: int) -> list[Lanes]:
            return [Lanes.constant(builder, each) for each in cgutils.unpack_tuple(builder, arguments[k])]

        zero = Lanes.constant(builder, 0.0)
        first = Supports(_rows_of(context, builder, signature.args[0], arguments[0], arguments[1]))
        e, M = first.half, vectors(2)
        members = Block(context, builder, signature.args[5], arguments[5], arguments[6])
        second = Supports(members.row)
        axes, f = members.matrix(AXES), second.half
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
        a, b = _Boxes(first, vectors(3), None), _Boxes(second, arm, columns)

        def toward(w: list[Lanes]) -> tuple[list[Lanes], Lanes, Lanes]:
            """Unit direction along w, and the gap along it."""
            length = norm(w).largest(Lanes.constant(builder, 1e-300))
            share = Lanes.constant(builder, 1.0) / length
            n = [each * share for each in w]
            reach = a.reach(n) + b.reach(_negative(n))
            return n, reach, inner(n, x) - reach

        (n, reach, gap), (m, other, wide) = toward(w), toward(x)  # the line of both centres is often better
        n = [m[k].where(wide - gap, n[k]) for k in range(3)]
        reach = other.where(wide - gap, reach)
        gap = wide.largest(gap)
        time = _Motion(builder, arguments[4]).times(n, reach, gap, a, b)
        store(context, builder, time, signature.args[7], arguments[7], arguments[8])
        return context.get_dummy_value()

    return signature, codegen


@inlined
def _turned(blocks_a: Any, a: int, member: int, reach_a: float, reach_b: float, move: Approach) -> Any:
    """Centre of a box, and a motion of all points of both trees, in the axes of the box."""
    center = blocks_a[a, CENTER, member], blocks_a[a, CENTER + 1, member], blocks_a[a, CENTER + 2, member]
    return turned_back(blocks_a, a, member, center), Approach(
        turned_back(blocks_a, a, member, move.v),
        turned_back(blocks_a, a, member, move.a),
        turned_back(blocks_a, a, member, move.w_a),
        turned_back(blocks_a, a, member, move.w_b),
        0.0,
        0.0,
        move.bend + move.bend_a * reach_a + move.bend_b * reach_b,
        0.0,
        0.0,
        move.jerk + move.jerk_a * reach_a + move.jerk_b * reach_b,
        move.start,
        move.growth,
        move.until,
    )


@device
def box_times(
    blocks_a: Any, root_a: int, place: int, blocks_b: Any, root_b: int, b: int, X: Any, move: Approach, out: Any,
    at: int,
) -> None:  # fmt: skip
    """Write times until which a box stays apart from the eight boxes of block b to out[at: at + 8] (s).

    place: of the box, WIDTH * block + member. root_a, root_b: first blocks of both trees. X: pose of the tree of b in
    the frame of the box's tree; move (Approach): in its axes.
    """
    a, member = place // WIDTH, place % WIDTH
    own, turned = _turned(blocks_a, a, member, blocks_a[root_a, REACH, 1], blocks_b[root_b, REACH, 1], move)
    _box_times(blocks_a, place, seen_from(blocks_a, a, member, X), own, turned, blocks_b, b, out, at)
